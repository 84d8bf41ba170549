#pragma once
/// What aligned_segments() found in the samples of a run and did not use.

#include <cstddef>
#include <string>

namespace abbe::calib::otf {

struct SetAside {
  std::size_t of_samples = 0;  ///< valid samples of the run, with the excluded ones
  /// Samples at places that the target cannot have reached from the places before and after:
  /// another reflector, a spike.
  std::size_t unreachable = 0;
  /// Samples off the line through their neighbours, across the direction of travel.
  std::size_t off_line = 0;
  /// Segments whose samples scatter more than those of the run; their uncertainty is increased.
  std::size_t noisy_segments = 0;
  std::size_t longest = 0;      ///< number of samples of the longest uninterrupted part
  double longest_from_s = 0.0;  ///< its beginning, from the first sample of the run
  std::size_t worst_leg = 0;    ///< leg with the most samples excluded
  std::size_t on_worst_leg = 0;

  [[nodiscard]] std::size_t samples() const { return unreachable + off_line; }
  [[nodiscard]] bool any() const { return samples() > 0 || noisy_segments > 0; }
};

/// Above this share of the samples set_aside_text() asks for a check of the set-up.
inline constexpr double kManySetAside = 0.02;
/// judge() refuses the model above this share (cause "outliers").
inline constexpr double kMostSetAside = 0.2;

/// One sentence for the verdict: how many samples were excluded, why, and where the most are.
[[nodiscard]] std::string set_aside_text(const SetAside&);

}  // namespace abbe::calib::otf
