"""``verbose=True``: runs print a line for each iterate or point; ``progress=True``: a bar, with tqdm where it is installed."""

import functools
import sys
from collections.abc import Callable
from typing import Any


def _line(told: dict[str, Any]) -> str:
    if "event" in told:
        return f"{told['arclength']:12.6g}  parameter {told['parameter']:<14.8g}  {told['event']}"
    return f"{told['index']:6d}  {told['strategy']:<18}  residual {told['residual']:.2e}  {told['step']}"


class _Bar:
    """The number of iterates or points so far."""

    def __init__(self, unit: str) -> None:
        self.count, self.unit, self.bar = 0, unit, None
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return
        self.bar = tqdm(unit=f" {unit}")

    def step(self) -> None:
        self.count += 1
        if self.bar is not None:
            self.bar.update()
        else:
            print(f"\r{self.count} {self.unit}", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
        elif self.count:
            print(file=sys.stderr)


def telling(function: Callable[..., Any], unit: str) -> Callable[..., Any]:
    """The function with the options ``verbose`` and ``progress``."""

    @functools.wraps(function)
    def told(*arguments: Any, verbose: bool = False, progress: bool = False, **options: Any) -> Any:
        if not (verbose or progress):
            return function(*arguments, **options)
        own, bar = options.pop("callback", None), _Bar(unit) if progress else None

        def callback(now: dict[str, Any]) -> Any:
            if verbose:
                print(_line(now))
            if bar is not None:
                bar.step()
            return own(now) if own is not None else None

        try:
            return function(*arguments, callback=callback, **options)
        finally:
            if bar is not None:
                bar.close()

    return told
