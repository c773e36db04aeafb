// Search results show an excerpt of each page, which must be fetched; pages opened from disk cannot.
if (location.protocol === "file:") {
  DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
}
