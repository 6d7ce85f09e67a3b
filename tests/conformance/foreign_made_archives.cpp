#include "corpus.hpp"
#include "small_archive.hpp"

namespace apgm::test {
namespace {

std::string gaps_between_numbers() {
  ArchiveParts archive;
  archive.next_number = 7;
  append_commit(archive, small_map());
  archive.next_number = 1'000'000'007;
  append_commit(archive, small_change(archive));
  return archive.bytes;
}

/// Replaced twice; the metadata of the map differ, and so does a policy.
std::string replaced_headers() {
  ArchiveParts archive = two_commits();
  MapHeader header = small_map().header;
  header.metadata = {{"apgm.archive.message", "better said"}, {"site", "Ulm"}};
  replace_header(archive, header);
  header.metadata["apgm.archive.tags"] = "a=1 b=2";
  header.stamp_ns = 5;
  replace_header(archive, header);
  append_commit(archive, small_change(archive, 0.125f));
  return archive.bytes;
}

/// Layers of the second commit from the last to the first.
std::string layers_in_no_order() {
  ArchiveParts archive = one_commit();
  Parts parts = small_map();
  std::ranges::reverse(parts.layers);
  parts.layers[0] = stored_constant({0, 1}, 0, 0, {bits(0.5f), 0});
  Hooks hooks;
  hooks.page = [](std::vector<Entry>& entries) { std::ranges::reverse(entries); };
  append_commit(archive, parts, hooks);
  return archive.bytes;
}

std::string unknown_blocks() {
  BlockHead head;
  head.kind = 9;
  head.commit = 2;
  return two_commits(with_before(kIndexPage, make_block(head, "what nobody needs to know"))).bytes;
}

/// Only the tags of the last footer count.
std::string older_tags_malformed() {
  ArchiveParts archive;
  Parts parts = small_map();
  parts.header.metadata = {{"apgm.archive.tags", "a=7 nonsense"}};
  append_commit(archive, parts);
  parts = small_change(archive);
  parts.header.metadata = {{"apgm.archive.tags", "a=1 z.+-9=2"}};
  append_commit(archive, parts);
  return archive.bytes;
}

/// A bit that forbids no more than to append, keys of the archive of a later version, small pages.
std::string later_version() {
  Hooks hooks;
  hooks.preamble = [](Preamble& p) {
    p.minor = 3;
    p.ro_compat = 4;
    p.compat = 3;
  };
  ArchiveParts archive;
  Parts parts = small_map();
  parts.page_entries = 1;
  parts.header.metadata = {{"apgm.archive.later", "x"}, {"apgm.archived", "not of the archive"}};
  append_commit(archive, parts, hooks);
  parts = small_change(archive);
  parts.page_entries = 2;
  parts.header.metadata = {{"apgm.archive.later", "y"}};
  append_commit(archive, parts);
  return archive.bytes;
}

/// What was torn holds a whole block and a footer that does not end where it says.
std::string torn_with_a_footer_of_another_size() {
  const ArchiveParts archive = one_commit();
  ArchiveParts next = archive;
  Hooks hooks;
  hooks.footer = [](Footer& f) { f.file_bytes += 8; };
  append_commit(next, small_change(next), hooks);
  return next.bytes + std::string(40, 't');
}

}  // namespace

std::vector<GoodFile> foreign_made_archives() {
  return {{"other_gaps_between_numbers", gaps_between_numbers()},
          {"other_replaced_headers", replaced_headers()},
          {"other_layers_in_no_order", layers_in_no_order()},
          {"other_unknown_blocks", unknown_blocks()},
          {"other_older_tags_malformed", older_tags_malformed()},
          {"other_later_version", later_version()},
          {"other_torn_with_a_footer_of_another_size", torn_with_a_footer_of_another_size()}};
}

}  // namespace apgm::test
