// of files that are opened from a disk, browsers let no page read another one
if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
