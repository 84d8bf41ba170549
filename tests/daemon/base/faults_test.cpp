/// The list of the faults of one file.

#include "abbe/base/faults.hpp"

#include <gmock/gmock.h>

#include <string>

namespace abbe::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

TEST(Faults, ShowAFaultOfManyLinesOnceWithItsCount) {
  Faults faults("t.csv");
  for (std::size_t line = 2; line < 414; ++line)
    faults.add_kind("not a number", line, 7, "z_mm", std::to_string(line) + "x: not a number");
  EXPECT_THAT(faults.lines(),
              ElementsAre("t.csv:2:7: z_mm: 2x: not a number, and 411 more like this"));
  EXPECT_EQ(faults.to_error().text, "t.csv: 412 faults");
}

TEST(Faults, ShowEachOfAFew) {
  Faults faults("t.csv");
  for (const std::size_t line : {2, 3, 5}) faults.add(line, 1, "z_mm", "empty");
  EXPECT_THAT(faults.lines(), ElementsAre("t.csv:2:1: z_mm: empty", "t.csv:3:1: z_mm: empty",
                                          "t.csv:5:1: z_mm: empty"));
}

TEST(Faults, OfTwoColumnsAreTwoKinds) {
  Faults faults("t.csv");
  for (const std::size_t line : {2, 3, 4, 5}) {
    faults.add(line, 3, "y_mm", "empty");
    faults.add(line, 5, "z_mm", "empty");
  }
  EXPECT_THAT(faults.lines(), ElementsAre("t.csv:2:3: y_mm: empty, and 3 more like this",
                                          "t.csv:2:5: z_mm: empty, and 3 more like this"));
}

TEST(Faults, ShowTheFirstOfAKindAlsoIfItIsAddedLast) {
  Faults faults("t.csv");
  for (const std::size_t line : {9, 8, 7, 6, 2}) faults.add(line, 1, "x_mm", "empty");
  EXPECT_THAT(faults.lines(), ElementsAre("t.csv:2:1: x_mm: empty, and 4 more like this"));
}

TEST(Faults, OfManyTablesOfAnArrayAreOneKind) {
  Faults faults("c.toml");
  for (const int i : {0, 1, 2, 13})
    faults.add(4 + 2 * static_cast<std::size_t>(i), 1, "ball[" + std::to_string(i) + "].r_mm",
               "unknown key");
  EXPECT_THAT(faults.lines(),
              ElementsAre("c.toml:4:1: ball[0].r_mm: unknown key, and 3 more like this"));
}

TEST(Faults, OfOneLineAreShownFromItsBegin) {
  Faults faults("t.csv");
  for (std::size_t i = 1; i <= 30; ++i) faults.add(1, i, "column " + std::to_string(i), "unknown");
  ASSERT_THAT(faults.lines(), SizeIs(Faults::kShown + 1));
  EXPECT_EQ(faults.lines().front(), "t.csv:1:1: column 1: unknown");
  EXPECT_EQ(faults.lines()[19], "t.csv:1:20: column 20: unknown");
}

TEST(Faults, AreCountedBeyondTheShownOnes) {
  Faults faults("t.csv");
  for (std::size_t i = 1; i <= 50; ++i) faults.add(i, 1, "column " + std::to_string(i), "unknown");
  ASSERT_THAT(faults.lines(), SizeIs(Faults::kShown + 1));
  EXPECT_EQ(faults.lines().back(), "t.csv: and 30 more");
}

}  // namespace
}  // namespace abbe::daemon
