"""What a structure can do from where it is: reachable and attainable sets."""
