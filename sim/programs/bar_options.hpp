#pragma once
/// The options of the Multi-Feature Bar and of its probing, which `abbe-sim mfb` and `abbe-sim bar`
/// share. In the options lengths are in mm, small errors in um.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/sim/mfb/files.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the name of CLI11
class App;
}

namespace abbe::sim {

inline constexpr double kFromMilli = 1e-3;
inline constexpr double kFromMicro = 1e-6;

struct BarOptions {
  std::string folder;
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> bar_seed;  ///< nullopt: the value of `seed`
  std::size_t holes = 12;
  double pitch_mm = 50.0, form_um = 0.3;
  double alpha_um_per_m_K = 1.0, u_alpha_um_per_m_K = 0.05;
  double temperature_C = 20.0, temperature_spread_K = 0.3, u_temperature_K = 0.05;
  bool stiff = false;
  bool exact = false;
  double mean_error_um = 0.0;
  double tip_radius_mm = 1.5, probe_um = 0.125, machine_um = 0.25;
  double lobing_um = 0.5, delay_ms = 1.0, feed_mm_per_min = 240.0, feed_scatter_percent = 0.2;
  double clamping_mm = 0.1, clamping_mrad = 0.3;
  std::vector<std::string> missed, outliers, turned;

  [[nodiscard]] double length_m() const { return 1e-3 * pitch_mm * static_cast<double>(holes - 1); }
};

/// The values in `options` are the defaults in the help.
void add_bar_options(CLI::App& app, BarOptions& options);

[[nodiscard]] mfb::TrueBar bar_of(const BarOptions& options);
/// The values that the files state: noise and uncertainties. Usage: an outlier that is not
/// TOUCH=UM, or a turned bar that is not NAME=AXIS.
[[nodiscard]] Result<mfb::ProbingOptions> probing_of(const BarOptions& options);
/// The values that are simulated: those of `stated`, or no noise and uncertainty at all (--exact).
[[nodiscard]] mfb::ProbingOptions simulated(const mfb::ProbingOptions& stated,
                                            const BarOptions& options);
/// Sets the thermal expansion and the sag that bar.toml states, from the options.
void set_properties(mfb::StatedBar& bar, const mfb::ProbingOptions& stated);

/// The two parts of "NAME=VALUE". Usage if there is no "=".
struct NameAndValue {
  std::string name, value;
};
[[nodiscard]] Result<NameAndValue> split_at_equals(const std::string& text,
                                                   std::string_view option);

struct NamedText {
  std::string name, text;
};
/// Creates the folder and writes the files into it. Error Io.
[[nodiscard]] Result<void> write_folder(const std::string& folder,
                                        const std::vector<NamedText>& files);
/// Converts an error to Usage: the value of an option does not name a touch or measurement of the
/// plan.
[[nodiscard]] Error as_usage(Error error);

}  // namespace abbe::sim
