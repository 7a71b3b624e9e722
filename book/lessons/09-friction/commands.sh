semismooth contact block.toml | grep changes
