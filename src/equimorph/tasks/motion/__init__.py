"""How motions of descriptors are followed: many targets at once, and with actuators to spare."""
