"""How is the book taught with?

Exercises stand in the chapters, with hint and solution. One module a step:

1. `exercises` finds them, with goal, time and kind; `grading` marks code;
2. `student` takes the solutions out, `leaks` looks whether any is left;
3. `labs` makes otter-grader's notebooks and graders, with `links` for their references;
4. `slides` puts the chapters' figures and numbers into the lectures;
5. `editions` does all of it.
"""
