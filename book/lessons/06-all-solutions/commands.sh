semismooth solutions pair.toml
