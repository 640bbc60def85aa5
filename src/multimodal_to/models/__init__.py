"""Models of what acts on the robot: jets, contacts, terrain, and the centroidal momentum they change."""
