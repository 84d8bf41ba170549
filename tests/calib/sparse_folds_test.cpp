#include "abbe/calib/sparse/folds.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

namespace {
using namespace abbe::calib;
using namespace abbe::calib::sparse;
using testing::ElementsAre;
using testing::HasSubstr;

std::vector<int> sizes(const Folds& folds) {
  std::vector<int> size(static_cast<std::size_t>(folds.count), 0);
  for (const int fold : folds.of_row) {
    ++size.at(static_cast<std::size_t>(fold));
  }
  return size;
}

TEST(SparseFolds, RandomFoldsDifferInSizeByAtMostOne) {
  EXPECT_THAT(sizes(random_folds(23, 5, 3).value()), ElementsAre(5, 5, 5, 4, 4));
}

TEST(SparseFolds, TheSameSeedGivesTheSameFolds) {
  EXPECT_EQ(random_folds(216, 10, 7)->of_row, random_folds(216, 10, 7)->of_row);
  EXPECT_NE(random_folds(216, 10, 7)->of_row, random_folds(216, 10, 8)->of_row);
}

TEST(SparseFolds, LabelsAreNumberedInIncreasingOrder) {
  const Folds folds = folds_from_labels(std::array{7, -1, 7, 3}).value();
  EXPECT_THAT(folds.of_row, ElementsAre(2, 0, 2, 1));
  EXPECT_EQ(folds.count, 3);
}

TEST(SparseFolds, ReadsAColumnOfLabelsWithOrWithoutHeading) {
  EXPECT_THAT(parse_folds("fold\n2\n 1\r\n\n2")->of_row, ElementsAre(1, 0, 1));
  EXPECT_THAT(parse_folds("2\n1\n")->of_row, ElementsAre(1, 0));
}

TEST(SparseFolds, NamesTheLineThatIsNoNumber) {
  EXPECT_THAT(parse_folds("fold\n2\nx\n").error().text, HasSubstr("line 3"));
}

TEST(SparseFolds, RefusesTooFewOfAnything) {
  EXPECT_EQ(random_folds(4, 5, 1).error().code, ErrorCode::TooFewObservations);
  EXPECT_EQ(random_folds(4, 1, 1).error().code, ErrorCode::TooFewObservations);
  EXPECT_EQ(folds_from_labels(std::array{1, 1}).error().code, ErrorCode::TooFewObservations);
  EXPECT_EQ(parse_folds("").error().code, ErrorCode::TooFewObservations);
}

}  // namespace
