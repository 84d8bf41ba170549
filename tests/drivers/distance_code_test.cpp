#include "abbe/drivers/sampling/distance_code.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "abbe/drivers/sampling/counter_alignment.hpp"
#include "abbe/drivers/sampling/mark_traverse.hpp"
#include "simulated_marks.hpp"

namespace abbe::tests {
namespace {

using drivers::DistanceCode;
using drivers::first_mark;
using drivers::MarkFault;
using drivers::MarkTraverse;
using drivers::MarkTraverseOptions;
using drivers::zero_of;

using Four = std::array<double, 4>;

const std::vector<DistanceCode> kCodes = {{.increment = 500, .length = 40'000},
                                          {.increment = 1000, .length = 100'000},
                                          {.increment = 2000, .length = 150'000},
                                          {.increment = 5000, .length = 255'000},
                                          {.increment = 500, .length = 18'000, .rotary = true},
                                          {.increment = 1000, .length = 36'000, .rotary = true}};

/// Four consecutive marks beginning with the i-th, crossed in `direction`.
Four four_of(const std::vector<std::int64_t>& marks, std::size_t i, int direction) {
  Four four{};
  for (std::size_t j = 0; j < 4; ++j)
    four[j] = static_cast<double>(marks[direction > 0 ? i + j : marks.size() - 1 - i - j]);
  return four;
}

template <class Do>
void for_every_four(const DistanceCode& code, Do what) {
  const auto marks = marks_of(code, 2);
  for (std::size_t i = 0; i + 3 < marks.size(); ++i)
    for (const int direction : {1, -1}) what(four_of(marks, i, direction));
}

/// Worked by hand for a scale of 20 um with N = 1000.
TEST(DistanceCode, GivesTheFirstMarkOfAPair) {
  const DistanceCode code{.increment = 1000, .length = 100'000};
  EXPECT_EQ(first_mark(code, 503, +1), 2000);
  EXPECT_EQ(first_mark(code, 503, -1), 2503);
  EXPECT_EQ(first_mark(code, 497, +1), 2503);
  EXPECT_EQ(first_mark(code, 497, -1), 3000);
}

TEST(DistanceCode, FindsEveryFourMarksOfEveryScale) {
  for (const DistanceCode& code : kCodes) {
    ASSERT_TRUE(drivers::check(code)) << drivers::check(code).error().text;
    for_every_four(code, [&](Four four) {
      const double truth = four[0];
      for (double& mark : four) mark -= 12'345.0;  // the counter's zero is anywhere
      const auto zero = zero_of(code, four);
      ASSERT_TRUE(zero) << code.increment << " at " << truth;
      const double error = zero->offset_periods - 12'345.0;
      const auto length = static_cast<double>(code.length);
      EXPECT_NEAR(code.rotary ? error - length * std::round(error / length) : error, 0.0, 1e-9);
    });
  }
}

TEST(DistanceCode, RefusesEveryOnePeriodErrorAtAnyOfFourMarks) {
  for (const DistanceCode& code : kCodes) {
    std::size_t tried = 0;
    for_every_four(code, [&](const Four& four) {
      for (std::size_t mark = 0; mark < 4; ++mark) {
        for (const double error : {-1.0, 1.0}) {
          Four wrong = four;
          wrong[mark] += error;
          ++tried;
          EXPECT_FALSE(zero_of(code, wrong))
              << code.increment << " at " << four[0] << ", mark " << mark;
        }
      }
    });
    EXPECT_GT(tried, 1000u);
  }
}

/// Between two marks a period is lost: everything behind is shifted.
TEST(DistanceCode, RefusesEverySlipOfOnePeriodBetweenMarks) {
  for (const DistanceCode& code : kCodes) {
    for_every_four(code, [&](const Four& four) {
      for (std::size_t from = 1; from < 4; ++from) {
        for (const double error : {-1.0, 1.0}) {
          Four wrong = four;
          for (std::size_t mark = from; mark < 4; ++mark) wrong[mark] += error;
          EXPECT_FALSE(zero_of(code, wrong))
              << code.increment << " at " << four[0] << ", from " << from;
        }
      }
    });
  }
}

TEST(DistanceCode, RefusesMarksWithOneMissing) {
  for (const DistanceCode& code : kCodes) {
    const auto marks = marks_of(code);
    for (std::size_t i = 0; i + 4 < marks.size(); ++i) {
      for (std::size_t missing = 1; missing < 4; ++missing) {
        Four four{};
        for (std::size_t j = 0; j < 4; ++j)
          four[j] = static_cast<double>(marks[i + j + (j >= missing ? 1 : 0)]);
        EXPECT_FALSE(zero_of(code, four)) << code.increment << " at " << four[0];
      }
    }
  }
}

TEST(DistanceCode, RefusesEveryOtherScale) {
  for (const DistanceCode& configured : kCodes) {
    for (const DistanceCode& actual : kCodes) {
      if (actual.increment == configured.increment) continue;
      for_every_four(actual, [&](const Four& four) {
        EXPECT_FALSE(zero_of(configured, four))
            << configured.increment << " for " << actual.increment;
      });
    }
  }
}

TEST(DistanceCode, RefusesAWrongSignalPeriodAndAScaleTheOtherWayRound) {
  const DistanceCode code{.increment = 1000, .length = 100'000};
  for_every_four(code, [&](const Four& four) {
    for (const double factor : {0.2, 0.5, 2.0, 5.0, -1.0}) {
      Four wrong = four;
      for (double& mark : wrong) mark *= factor;
      EXPECT_FALSE(zero_of(code, wrong)) << factor << " at " << four[0];
    }
  });
}

TEST(DistanceCode, RefusesDistancesBetweenPeriods) {
  const DistanceCode code{.increment = 1000, .length = 100'000};
  EXPECT_EQ(zero_of(code, Four{0.0, 501.3, 1000.0, 1502.0}).error(), MarkFault::NotWhole);
  EXPECT_TRUE(zero_of(code, Four{0.0, 501.1, 1000.0, 1502.0}));
}

TEST(DistanceCode, RefusesADirectionThatChanges) {
  const DistanceCode code{.increment = 1000, .length = 100'000};
  EXPECT_EQ(zero_of(code, Four{0.0, 501.0, 0.0, 501.0}).error(), MarkFault::Reversed);
}

TEST(DistanceCode, ChecksItsConfiguration) {
  EXPECT_FALSE(drivers::check({.increment = 999, .length = 50'000}));
  EXPECT_FALSE(drivers::check({.increment = 1000, .length = 1'500}));
  EXPECT_FALSE(drivers::check({.increment = 500, .length = 500'000}));
  EXPECT_FALSE(drivers::check({.increment = 1000, .length = 36'500, .rotary = true}));
  EXPECT_TRUE(drivers::check({.increment = 1000, .length = 36'000, .rotary = true}));
}

/// An axis that is driven back and forth over its scale, its marks read with noise. Its faults are
/// drawn at random; the zero found at the end is compared with the true one.
class Traverse {
 public:
  Traverse(const DistanceCode& code, std::mt19937& random)
      : random_(random), marks_(marks_of(code, 2)), options_{.code = code} {
    options_.counts_per_period = 20.0;
    zero_ = static_cast<std::int64_t>(random_() % 2'000'000) - 1'000'000;
    at_ = 2 + random_() % (marks_.size() - 4);
    direction_ = random_() % 2 == 0 ? 1 : -1;
  }

  /// True if a zero was given and is wrong.
  bool gives_a_wrong_zero() {
    MarkTraverse traverse{options_};
    for (int crossed = 0; crossed < 14; ++crossed) {
      if (chance(0.08)) turn_round(traverse);
      if (at_end()) turn_round(traverse);
      if (chance(0.02) && fault()) zero_ += chance(0.5) ? 20 : -20;  // a period is lost or found
      cross(traverse);
      if (wrong_) return true;
      if (found_) return false;
    }
    return false;
  }
  [[nodiscard]] bool found() const { return found_; }

 private:
  bool chance(double p) { return std::uniform_real_distribution<double>{}(random_) < p; }
  /// At most one per traverse: two faults within four marks can give another valid sequence.
  bool fault() { return !std::exchange(faulty_, true); }
  [[nodiscard]] bool at_end() const { return direction_ > 0 ? at_ + 1 >= marks_.size() : at_ == 0; }
  [[nodiscard]] std::int64_t count(double periods) const {
    return std::llround(periods * options_.counts_per_period) - zero_;
  }
  void turn_round(MarkTraverse& traverse) {
    const double beyond = static_cast<double>(marks_[at_]) + 100.0 * direction_;
    traverse.on_position(count(beyond));
    traverse.on_position(count(beyond - 2.0 * direction_));
    direction_ = -direction_;
    reread_ = true;  // the mark just crossed comes first
  }
  void cross(MarkTraverse& traverse) {
    if (!std::exchange(reread_, false)) at_ = direction_ > 0 ? at_ + 1 : at_ - 1;
    if (chance(0.02) && fault()) return;  // a mark that is not seen
    const auto mark = static_cast<double>(marks_[at_]);
    traverse.on_position(count(mark - 3.0 * direction_));
    const double noise = std::normal_distribution<double>{0.0, 0.04}(random_);
    const auto outcome = traverse.on_mark(count(mark + noise));

    if (!outcome || !*outcome) return;
    found_ = true;
    const double counter = static_cast<double>(count(mark)) / options_.counts_per_period;
    double error = counter + (*outcome)->offset_periods - mark;
    const auto length = static_cast<double>(options_.code.length);
    if (options_.code.rotary) error -= length * std::round(error / length);
    wrong_ = std::abs(error) > 0.25;
  }

  std::mt19937& random_;
  std::vector<std::int64_t> marks_;
  MarkTraverseOptions options_;
  std::int64_t zero_ = 0;
  std::size_t at_ = 0;
  int direction_ = 1;
  bool reread_ = false;
  bool faulty_ = false;
  bool found_ = false;
  bool wrong_ = false;
};

TEST(MarkTraverseFigure, NoWrongZeroInAHundredThousandTraverses) {
  std::mt19937 random(4711);
  int wrong = 0;
  int found = 0;
  for (int i = 0; i < 100'000; ++i) {
    Traverse traverse{kCodes[static_cast<std::size_t>(i) % kCodes.size()], random};
    wrong += traverse.gives_a_wrong_zero() ? 1 : 0;
    found += traverse.found() ? 1 : 0;
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(found, 75'000);
  RecordProperty("found", found);
}

MarkTraverseOptions one_count_per_period() {
  return {.code = {.increment = 1000, .length = 100'000}, .counts_per_period = 1.0};
}

TEST(MarkTraverse, NeedsFourMarksOfOneDirection) {
  MarkTraverse traverse{one_count_per_period()};
  EXPECT_FALSE(traverse.on_mark(2000));
  EXPECT_FALSE(traverse.on_mark(2503));
  EXPECT_FALSE(traverse.on_mark(3000));
  const auto zero = traverse.on_mark(3504);
  ASSERT_TRUE(zero && *zero);
  EXPECT_EQ((*zero)->offset_periods, 0.0);
}

TEST(MarkTraverse, RestartsAfterAReversalBetweenTwoMarks) {
  MarkTraverse traverse{one_count_per_period()};
  (void)traverse.on_mark(2000);
  (void)traverse.on_mark(2503);
  traverse.on_position(2600);
  traverse.on_position(2400);
  traverse.on_position(2450);
  const auto outcome = traverse.on_mark(2503);  // crossed again, upwards
  ASSERT_TRUE(outcome && !*outcome);
  EXPECT_EQ(outcome->error(), MarkFault::Reversed);
  EXPECT_EQ(traverse.marks(), 1u);
}

TEST(MarkTraverse, DetectsAScaleThatCountsBackwards) {
  MarkTraverseOptions options = one_count_per_period();
  options.counts_per_period = -4.0;
  MarkTraverse traverse{options};
  std::optional<tl::expected<drivers::MarkZero, MarkFault>> outcome;
  for (const std::int64_t mark : {2000, 2503, 3000, 3504})
    outcome = traverse.on_mark(-4 * mark + 40);
  ASSERT_TRUE(outcome && *outcome);
  EXPECT_NEAR((*outcome)->offset_periods, 10.0, 1e-12);
}

TEST(MarkTraverse, ReportsThatTheScaleIsAnotherOne) {
  MarkTraverse traverse{one_count_per_period()};
  std::vector<MarkFault> faults;
  for (const std::int64_t mark : marks_of({.increment = 2000, .length = 100'000})) {
    const auto outcome = traverse.on_mark(mark);
    ASSERT_FALSE(outcome && *outcome);
    if (outcome) faults.push_back(outcome->error());
  }
  ASSERT_GT(faults.size(), 4u);
  EXPECT_EQ(faults.front(), MarkFault::NotOfCode);
  EXPECT_EQ(faults.back(), MarkFault::WrongScale);
}

TEST(CounterAlignment, NarrowsTheDifferenceFromMarkToMark) {
  drivers::CounterAlignment alignment;
  EXPECT_FALSE(alignment.difference());
  EXPECT_TRUE(alignment.add(1'000, 3, 7));
  EXPECT_TRUE(alignment.add(2'000, 1'002, 1'005));
  ASSERT_TRUE(alignment.difference());
  EXPECT_EQ(*alignment.difference(), 996.0);  // [993, 997] and [995, 998]
  EXPECT_EQ(alignment.half_width(), 1.0);
}

TEST(CounterAlignment, ReportsThatACardMiscounted) {
  drivers::CounterAlignment alignment;
  EXPECT_TRUE(alignment.add(1'000, 3, 7));
  EXPECT_FALSE(alignment.add(2'010, 1'002, 1'005));
  EXPECT_FALSE(alignment.difference());
}

}  // namespace
}  // namespace abbe::tests
