semismooth follow node.toml
