"""The compiled engine: its C sources, its library, and how Python hands numbers over."""
