#pragma once
/// A random machine, a Multi-Feature Bar touched on it, and typical faults of a shop floor; then
/// the verdict of the gate, and the error of the model against the truth. Deterministic from the
/// seed.

#include <functional>
#include <random>
#include <vector>

#include "abbe/calib/mfb/judge/judge.hpp"
#include "campaign.hpp"
#include "mfb_simulation.hpp"

namespace abbe::tests::never_worse {

using calib::Vector3;

/// The true machine and bar, and what the files state about them; a fault changes the truth, the
/// files or the touches.
struct MfbRun {
  mfb::SimulatedMachine machine;
  calib::mfb::Plan plan;        ///< as driven; temperatures as measured
  mfb::ProbingOptions probing;  ///< the truth
  /// Changes what the files state, and the touches; may be empty.
  std::function<void(calib::mfb::Bar&, calib::mfb::Plan&, std::vector<calib::mfb::PassTouches>&)>
      spoil{};
  calib::mfb::MfbMachine stated;
  std::mt19937_64 random;

  /// Adds a displacement of the touched places of the bar.
  void displace(std::function<Vector3(const mfb::TouchMade&)> by);
  /// Adds an error of the machine.
  void add_error(std::function<Vector3(const mfb::TouchMade&, const Vector3& reading_m)> by);
};

[[nodiscard]] std::vector<Fault<MfbRun>> mfb_faults();
[[nodiscard]] MfbRun random_mfb_run(std::uint64_t seed);
[[nodiscard]] Outcome identify_and_compare_mfb(MfbRun run);

}  // namespace abbe::tests::never_worse
