#include "apgm/core/text.hpp"

#include <gmock/gmock.h>

#include <string>

namespace apgm {
namespace {

TEST(TextTest, TakesUtf8) {
  for (const char* good : {"", "map",
                           "Ulm \xe2\x80\x93 S\xc3\xbc"
                           "d",
                           "\xf0\x9f\x97\xba", "a\tb\n"}) {
    EXPECT_TRUE(is_utf8(good)) << good;
  }
}

TEST(TextTest, RefusesWhatIsNotUtf8) {
  for (const char* bad :
       {"\xff", "\x80", "\xc0\xaf", "\xe2\x80", "\xe0\x80\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80"}) {
    EXPECT_FALSE(is_utf8(bad));
  }
  EXPECT_FALSE(is_utf8(std::string("a\0b", 3)));
}

TEST(TextTest, PlainTextHasNoControlCharacters) {
  EXPECT_TRUE(is_plain_text("odom \xc3\xbc"));
  EXPECT_FALSE(is_plain_text("a\nb"));
  EXPECT_FALSE(is_plain_text("\x1b[31m"));
  EXPECT_FALSE(is_plain_text("\x7f"));
}

}  // namespace
}  // namespace apgm
