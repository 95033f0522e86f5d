"""From a grid over the parameters to a complex: lift edges, close loops, discs and balls."""
