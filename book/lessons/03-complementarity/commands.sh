semismooth solutions market.toml
