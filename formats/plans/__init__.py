"""Plans, maps and drawings, and the small files beside them."""
