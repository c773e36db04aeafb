"""Do agents that see forecast and quantile learn to use them, and why not?"""
