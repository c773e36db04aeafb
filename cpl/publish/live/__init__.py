"""What live figures are made of: data in classic scripts, and the pictures that stand in for them.

The files are written into the stage of each build, from the package and from published results,
and never kept in git: there is nothing in them that could go stale.
"""

from cpl.publish.live._files import files_for_page, files_for_site
from cpl.publish.live._script import as_script

__all__ = ["as_script", "files_for_page", "files_for_site"]
