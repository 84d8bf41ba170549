#pragma once
/// Scale readings with times of the machine's clock, for an on-the-fly identification that also
/// uses the component along the direction of travel.

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// `u_time_us`: standard uncertainty of the time of one reading.
[[nodiscard]] calib::otf::EncoderLog encoder_log(std::span<const EncoderRow>, double u_time_us);

/// The relation of the clocks as the files have them, from that of times since their first rows.
[[nodiscard]] calib::otf::ClockMap clock_of_files(const calib::otf::ClockMap&,
                                                  const TimesOfFile& tracker,
                                                  const TimesOfFile& encoder);

/// Offset and drift of the clocks with standard uncertainties, and what the readings contributed:
/// lines of the summary.
[[nodiscard]] std::string clock_text(const calib::otf::Synchronisation&, double u_time_us);
[[nodiscard]] nlohmann::json clock_json(const calib::otf::Synchronisation&, double u_time_us);

}  // namespace abbe::daemon
