"""What a component is made of: materials, sections, parts, supports; kept in a file."""
