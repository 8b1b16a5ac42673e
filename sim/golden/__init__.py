"""Golden models: one clock of every method as a pure function, written from the documents.

They import neither Amaranth nor the device: they are the second opinion on both.
"""
