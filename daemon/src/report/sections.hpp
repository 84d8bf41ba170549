#pragma once
/// What the reports of several methods have in common.

#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/gate.hpp"
#include "abbe/daemon/html_report.hpp"
#include "abbe/daemon/input_files.hpp"

namespace abbe::daemon {

/// "12.35 um".
[[nodiscard]] std::string um_text(double length_m, int decimals = 2);
[[nodiscard]] std::vector<double> in_um(const std::vector<double>& lengths_m);

/// The gate's verdict and what it stands on. `held_out`: "legs", "positions": what the fit did not see.
void add_verdict(HtmlReport& page, const calib::Verdict& verdict, std::string_view held_out,
                 int decimals = 2);

/// Files with their hashes; nothing without files.
void add_inputs(HtmlReport& page, const std::vector<InputFile>& inputs);

}  // namespace abbe::daemon
