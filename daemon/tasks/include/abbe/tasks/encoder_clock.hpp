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

/// Converts the relation of the clocks from times since the first rows to the times in the files.
[[nodiscard]] calib::otf::ClockMap clock_of_files(const calib::otf::ClockMap&,
                                                  const TimesOfFile& tracker,
                                                  const TimesOfFile& encoder);

/// Lines of the summary: offset and drift of the clocks with standard uncertainties, and the
/// contribution of the readings.
[[nodiscard]] std::string clock_text(const calib::otf::Synchronisation&, double u_time_us);
[[nodiscard]] nlohmann::json clock_json(const calib::otf::Synchronisation&, double u_time_us);

}  // namespace abbe::daemon
