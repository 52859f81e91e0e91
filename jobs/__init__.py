"""The kinds of job: what each asks for, what happens next in it, and what people read of it."""
