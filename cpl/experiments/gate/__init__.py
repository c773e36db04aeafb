"""Does a look-ahead whose margin is tracked drive well when the world changes?"""
