semismooth diagram island.toml | grep -E 'fold|branches'
