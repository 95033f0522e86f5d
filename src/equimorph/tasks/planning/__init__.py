"""Planning: the best route between two states, without a snap or with snaps at a price."""
