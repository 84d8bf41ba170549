// V for a direction of travel, identified on the fly: simulated machines with known backlash.
#include <gtest/gtest.h>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "backlash_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

/// The eight directions of three axes.
std::vector<AxisTravel> all_directions() {
  std::vector<AxisTravel> all;
  for (int i = 0; i < 8; ++i) {
    AxisTravel travel;
    for (std::size_t a = 0; a < 3; ++a) {
      travel[a] = (i >> a & 1) != 0 ? Travel::Forward : Travel::Backward;
    }
    all.push_back(travel);
  }
  return all;
}

struct DirectionErrors {
  double mean_m = 0.0;      ///< of V minus V of the machine
  double normalised = 0.0;  ///< mean square of its components over their variances
};

/// At all nodes in all directions; `known`: the model is given the direction.
DirectionErrors errors_in_all_directions(const MadeRun& run, const BacklashOfRun& backlash,
                                         const VolumetricModel& model, bool known) {
  const auto basis = basis_with(layout_of(run.machine), backlash);
  Eigen::VectorXd truth(run.truth.size() + backlash.values.size());
  truth << run.truth, backlash.values;
  const Vector3& t = run.machine.target_offset_m;

  DirectionErrors errors;
  double count = 0.0;
  for (const Vector3& q : tensor_grid(run.machine.nodes)) {
    for (const AxisTravel& travel : all_directions()) {
      const Vector3 V =
          basis.V_m({.q_m = q, .tool_offset_m = t, .travel = travel}, {truth.data(), basis.size()});
      const VolumetricError e = model.error_at(q, t, known ? travel : AxisTravel{});
      errors.mean_m += (e.V_m - V).norm();
      errors.normalised += (e.V_m - V).cwiseAbs2().cwiseQuotient(e.cov_V_m2.diagonal()).sum() / 3.0;
      ++count;
    }
  }
  return {errors.mean_m / count, errors.normalised / count};
}

class TravelOfARun : public testing::TestWithParam<TravelDependence> {
 protected:
  /// Differences within 8 um or urad.
  static BacklashOfRun truth_of(const MadeRun& run, unsigned seed) {
    const ParameterLayout layout = layout_of(run.machine);
    const std::size_t count = GetParam() == TravelDependence::Backlash ? layout.tables().size()
                                                                       : layout.squareness_offset();
    BacklashOfRun truth{Eigen::VectorXd(static_cast<Eigen::Index>(count))};
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-8e-6, 8e-6);
    for (double& b : truth.values) {
      b = uniform(random);
    }
    return truth;
  }
};
INSTANTIATE_TEST_SUITE_P(OtfKinds, TravelOfARun,
                         testing::Values(TravelDependence::Backlash, TravelDependence::Tables));

/// A test value of 8 um per table is 5 um of V in the mean direction.
TEST_P(TravelOfARun, GivesVInEveryDirectionWithinItsUncertainty) {
  constexpr unsigned kSeeds = 6;
  double known = 0.0, unknown = 0.0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const MadeRunOptions wanted{.seed = seed, .noise_seed = seed, .in_datum = true};
    MadeRun run = make_run(wanted);
    const BacklashOfRun truth = truth_of(run, seed);
    run = make_backlash_run(wanted, truth);
    run.options.backlash = GetParam();
    const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
    ASSERT_TRUE(id) << id.error().text;

    const VolumetricModel& model = id->solution.model;
    const DirectionErrors with = errors_in_all_directions(run, truth, model, true),
                          without = errors_in_all_directions(run, truth, model, false);
    EXPECT_LT(with.mean_m, 0.25 * without.mean_m);
    known += with.normalised / kSeeds;
    unknown += without.normalised / kSeeds;
  }
  RecordProperty("known", std::to_string(known));
  RecordProperty("unknown", std::to_string(unknown));
  EXPECT_GT(known, 0.6);
  EXPECT_LT(known, 1.5);
  EXPECT_GT(unknown, 0.7);
  EXPECT_LT(unknown, 1.3);
}

}  // namespace
