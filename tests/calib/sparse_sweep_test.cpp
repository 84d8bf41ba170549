#include "abbe/calib/internal/sparse/sweep.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "sparse_solution.hpp"

namespace {
using namespace abbe::calib::sparse;
using namespace abbe::tests::sparse;

/// Eight lassos of one random Gram matrix, with different lambdas and different columns excluded.
struct Eight {
  static constexpr std::size_t kColumns = 12;
  std::vector<double> gram, xty;
  std::vector<LaneMask> mask{kColumns};
  std::vector<Lanes> b{kColumns};
  LaneParameters parameters;

  explicit Eight(unsigned seed) : gram(kColumns * kColumns), xty(kColumns) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (std::size_t i = 0; i < kColumns; ++i) {
      xty[i] = uniform(random);
      for (std::size_t j = 0; j < i; ++j) {
        gram[i * kColumns + j] = gram[j * kColumns + i] = 0.08 * uniform(random);
      }
      gram[i * kColumns + i] = 1.0;
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        mask[i].of[lane] = uniform(random) > -0.5 ? -1 : 0;
      }
    }

    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      parameters.lambda.of[lane] = 0.05 * static_cast<double>(lane);
      parameters.inner_end.of[lane] = parameters.outer_end.of[lane] = 1e9;
    }
  }

  SweepOutcome run(SweepFunction sweep, long count) {
    return sweep({kColumns, gram.data(), xty.data(), mask.data(), b.data()}, parameters, count);
  }

  /// One sweep of one lane in plain loops.
  void sweep_plainly(std::size_t lane) {
    for (std::size_t j = 0; j < kColumns; ++j) {
      double z = xty[j];
      for (std::size_t step = 1; step < kColumns; ++step) {
        const std::size_t k = (j + step) % kColumns;
        z -= gram[j * kColumns + k] * b[k].of[lane];
      }
      const double fresh = minimiser({PenaltyKind::Lasso}, parameters.lambda.of[lane], z);
      b[j].of[lane] = mask[j].of[lane] != 0 ? fresh : 0.0;
    }
  }
};

bool same_bits(const std::vector<Lanes>& a, const std::vector<Lanes>& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(Lanes)) == 0;
}

TEST(SparseSweep, GivesTheSameBitsWithEveryWidthOfRegisters) {
  for (const SweepVariant& variant : sweep_variants()) {
    Eight here(1), baseline(1);
    here.run(variant.sweep, 7);
    baseline.run(sweep_variants().back().sweep, 7);
    EXPECT_TRUE(same_bits(here.b, baseline.b)) << variant.instructions;
  }
}

TEST(SparseSweep, IsCoordinateDescentLaneByLane) {
  Eight fast(2), plain(2);
  fast.run(sweep_variants().front().sweep, 3);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    for (int sweep = 0; sweep < 3; ++sweep) {
      plain.sweep_plainly(lane);
    }
    for (std::size_t j = 0; j < Eight::kColumns; ++j) {
      EXPECT_NEAR(fast.b[j].of[lane], plain.b[j].of[lane], 1e-15) << lane << ' ' << j;
    }
  }
}

TEST(SparseSweep, StopsWhenTheFirstLaneHasConverged) {
  for (const SweepVariant& variant : sweep_variants()) {
    Eight eight(3);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      eight.parameters.tolerance.of[lane] = lane == 5 ? 1e-6 : -1.0;
    }
    const SweepOutcome outcome = eight.run(variant.sweep, 1000);
    EXPECT_EQ(outcome.converged, 1U << 5) << variant.instructions;
    EXPECT_LT(outcome.sweeps, 1000);
  }
}

}  // namespace
