"""A motion is searched for here where no region helps: by a sampling planner, in a child process, and then certified as a motion."""
