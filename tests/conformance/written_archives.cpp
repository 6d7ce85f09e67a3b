// Archives as the library's writer makes them, and what interrupted appends leave of them.

#include "bodies.hpp"
#include "corpus.hpp"
#include "temp_dir.hpp"
#include "tests/format/archive_support.hpp"

namespace apgm::test {
namespace {

MapHeader header_of(std::vector<LayerType> types, std::int64_t stamp_ns) {
  MapHeader header;
  header.types = TypeTable(std::move(types));
  header.stamp_ns = stamp_ns;
  return header;
}

const std::vector<LayerType> kTypes{LayerType::occupancy(), LayerType::real("z", {"z"})};

/// Four patches of occupancy, two of heights.
Map first_map() {
  Map map(header_of(kTypes, 1000));
  for (int x = -2; x < 2; ++x) {
    Layer& layer = map.layer({x, 0}, 0, 2);
    for (std::size_t i = 0; i < 9; ++i) layer.plane(x < 0 ? 0 : 1)[i] = static_cast<float>(i + 1) / 16.0f;
    layer.stamp_ns = 10 + x;
    if (x >= 0) map.layer({x, 0}, 1, 1).plane(0)[0] = static_cast<float>(x) - 0.5f;
  }
  return map;
}

/// One layer has other cells, one another stamp only, one is gone, one is new.
Map second_map() {
  Map map = first_map();
  map.set_stamp_ns(2000);
  map.layer({-2, 0}, 0, 2).plane(0)[3] = 0.875f;
  map.layer({-1, 0}, 0, 2).stamp_ns = 99;
  map.extract({0, 0}, 1);
  map.layer({0, 1}, 0, 0).plane(1)[0] = 1;
  return map;
}

/// A type whose name comes first: the others get other numbers. One more that no layer is of.
Map with_new_types(const Map& map) {
  Map next(header_of(
      {LayerType::semantic("markings", {"a", "b"}), kTypes[0], LayerType::real("unused", {"u"}), kTypes[1]},
      3000));
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      const TypeId id = *next.header().types.find(map.header().types[type].name);
      next.layer(patch.index, id, layer.step()) = layer;
    }
  }
  Layer& markings = next.layer({1, 0}, *next.header().types.find("markings"), 1);
  markings.plane(0)[2] = 0.5f;
  markings.plane(2)[2] = 0.5f;
  return next;
}

/// An archive that grows in a file.
class Growing {
 public:
  void commit(const Map& next, const CommitOptions& options = {}) {
    commit_map(path(), base_, next, options);
    base_ = next;
  }
  void tag(const std::string& name, std::uint64_t number = 0) { tag_commit(path(), name, number); }
  std::string path() const { return dir_ / "a.apgm"; }
  std::string bytes() const { return read_file(path()); }

 private:
  TempDir dir_;
  Map base_ = empty_map();
};

std::string one_commit() {
  Growing archive;
  archive.commit(first_map());
  return archive.bytes();
}

std::string two_commits() {
  Growing archive;
  archive.commit(first_map(), {.message = "first"});
  archive.commit(second_map(), {.message = "second"});
  return archive.bytes();
}

std::string changed_gone_and_new() {
  Growing archive;
  archive.commit(first_map());
  archive.commit(second_map());
  archive.commit(first_map());
  archive.commit(first_map());  // nothing changed
  return archive.bytes();
}

std::string new_types() {
  Growing archive;
  archive.commit(second_map());
  archive.commit(with_new_types(second_map()));
  archive.commit(first_map());
  return archive.bytes();
}

std::string emptied() {
  Growing archive;
  archive.commit(empty_map());
  archive.commit(first_map());
  archive.commit(empty_map());
  return archive.bytes();
}

/// More than a page; the second commit changes a layer of the last one only.
std::string shared_pages() {
  Map map(header_of({LayerType::occupancy()}, 0));
  for (int i = 0; i < 1100; ++i)
    map.layer({i % 32, i / 32}, 0, 0).plane(1)[0] = static_cast<float>(i + 1) / 2048;
  Growing archive;
  archive.commit(map);
  const PatchIndex last = map.by_key().rbegin()->second.index;
  map.layer(last, 0, 0).plane(1)[0] = 0.75f;
  archive.commit(map);
  return archive.bytes();
}

void tag_and_move(Growing& archive) {
  archive.commit(first_map(), {"the first\nof \xc3\xa4ll", {"base", "latest"}});
  archive.commit(second_map(), {"", {"latest"}});
  archive.tag("v1.0", 1);
  archive.commit(first_map(), {"third", {}});
  archive.tag("_", 2);
  archive.tag("latest", 3);
}

std::string tags_and_messages() {
  Growing archive;
  tag_and_move(archive);
  return archive.bytes();
}

std::string tag_taken_away() {
  Growing archive;
  tag_and_move(archive);
  remove_tag(archive.path(), "v1.0");
  return archive.bytes();
}

std::string only_tag_taken_away() {
  Growing archive;
  archive.commit(first_map(), {"", {"only"}});
  remove_tag(archive.path(), "only");
  return archive.bytes();
}

std::string compacted(std::uint64_t keep) {
  Growing archive;
  tag_and_move(archive);
  for (const Map& map : {second_map(), with_new_types(first_map()), first_map(), second_map()})
    archive.commit(map);
  archive.tag("_", 5);
  compact_archive(archive.path(), {.keep = keep});
  if (keep > 0) archive.commit(first_map(), {.message = "after the gap"});
  return archive.bytes();
}

/// The second commit of `whole`, of which only `left` bytes reached the disk.
std::string torn(const std::string& whole, std::size_t left) { return whole.substr(0, left); }

}  // namespace

std::vector<GoodFile> written_archives() {
  const std::string first = one_commit(), two = two_commits();
  const std::string first_of_two = [&] {
    Growing archive;
    archive.commit(first_map(), {.message = "first"});
    return archive.bytes();
  }();
  const std::size_t footer = two.size() - 256;
  std::string marks_14 = two;
  marks_14[footer] = marks_14[two.size() - 1] = 0;
  return {{"one_commit", first},
          {"two_commits", two},
          {"changed_gone_and_new", changed_gone_and_new()},
          {"new_types", new_types()},
          {"emptied", emptied()},
          {"shared_pages", shared_pages()},
          {"tags_and_messages", tags_and_messages()},
          {"tag_taken_away", tag_taken_away()},
          {"only_tag_taken_away", only_tag_taken_away()},
          {"compacted", compacted(0)},
          {"compacted_with_gaps", compacted(2)},
          {"torn_one_byte", torn(two, first_of_two.size() + 1)},
          {"torn_in_blocks", torn(two, (first_of_two.size() + footer) / 2 | 3)},
          {"torn_before_footer", torn(two, footer)},
          {"torn_in_footer", torn(two, footer + 100)},
          {"torn_one_byte_short", torn(two, two.size() - 1)},
          {"torn_zeros", first_of_two + std::string(two.size() - first_of_two.size(), '\0')},
          {"torn_far_from_the_footer", first_of_two + std::string(200'000, 'x')},
          {"torn_copy_of_the_footer", first_of_two + first_of_two.substr(first_of_two.size() - 256) + "torn"},
          {"torn_14_bytes_of_marks", marks_14}};
}

}  // namespace apgm::test
