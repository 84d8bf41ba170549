#include "abbe/calib/sparse/folds.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <set>

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

TEST(SparseFolds, GroupsStayTogether) {
  std::vector<int> ball;
  for (int row = 0; row < 216; ++row) {
    ball.push_back(100 + row / 3);
  }
  const Folds folds = group_folds(ball, 10, 5).value();
  for (std::size_t row = 0; row < 216; row += 3) {
    EXPECT_EQ(folds.of_row[row], folds.of_row[row + 1]);
    EXPECT_EQ(folds.of_row[row], folds.of_row[row + 2]);
  }
  EXPECT_EQ(std::set<int>(folds.of_row.begin(), folds.of_row.end()).size(), 10U);
}

TEST(SparseFolds, AsManyFoldsAsGroupsLeavesOneOutAtATime) {
  const Folds folds = group_folds(std::array{4, 4, 9, 2, 2, 2}, 3, 1).value();
  EXPECT_NE(folds.of_row[0], folds.of_row[2]);
  EXPECT_NE(folds.of_row[2], folds.of_row[3]);
  EXPECT_EQ(folds.of_row[3], folds.of_row[5]);
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
  EXPECT_EQ(group_folds(std::array{1, 1, 2}, 3, 1).error().code, ErrorCode::TooFewObservations);
  EXPECT_EQ(folds_from_labels(std::array{1, 1}).error().code, ErrorCode::TooFewObservations);
  EXPECT_EQ(parse_folds("").error().code, ErrorCode::TooFewObservations);
}

}  // namespace
