"""How does a text chapter with typed parameters become a page?

A chapter is a MyST text notebook, `book/<name>.md`. Its way to the page, one module a step:

1. `chapters` finds the chapters and splits them into cells; `parameters` reads the typed parameters
   and refuses, before anything runs, what they may not be; `contract` checks the chapter's form;
2. `cache` says whether an execution with the same source, parameters, code, data and versions is
   at hand; if not, `execute` runs the chapter with papermill, whole or not at all;
3. `provenance` writes down what made the result and puts it at the end of the page;
4. `stage` lays the executed chapters out, `render` runs Jupyter Book over a stage, `site` does all
   of it, and `page` makes one chapter into a file that stands alone;
5. `course` makes of the same chapters what a teacher needs, and an edition without solutions.

Only `glue` is imported here, because every chapter imports this package and is executed again when
code that it imports changes; the steps above are imported by the command line, one by one.
"""

from cpl.publish._glue import glue

__all__ = ["glue"]
