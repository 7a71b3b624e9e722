semismooth contact block.toml | cut -c 1-70   # the table without energies
