#!/bin/sh
# Writes docs/cli: one page a tool, from its --help and those of its commands.
#   write_docs.sh BIN_DIR OUT_DIR
set -eu
bin=$1
out=$2
mkdir -p "$out"
for tool in apgm apgm-info apgm-convert apgm-merge apgm-crop apgm-diff apgm-resample apgm-map apgm-compare apgm-archive apgm-verify apgm-render; do
  {
    printf '# %s\n\nWritten from `%s --help` by the target `cli_docs`.\n\n```text\n' "$tool" "$tool"
    "$bin/$tool" --help
    printf '```\n'
  } >"$out/$tool.md"
done
for command in commit log checkout compact tag; do
  {
    printf '\n## apgm-archive %s\n\n```text\n' "$command"
    "$bin/apgm-archive" "$command" --help
    printf '```\n'
  } >>"$out/apgm-archive.md"
done
