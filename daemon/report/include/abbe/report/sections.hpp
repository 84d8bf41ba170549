#pragma once
/// What the reports of several methods have in common.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/calib/gate.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// "12.35 um".
[[nodiscard]] std::string um_text(double length_m, int decimals = 2);
[[nodiscard]] std::vector<double> in_um(const std::vector<double>& lengths_m);

/// The gate's verdict and what it stands on. `held_out`: "legs", "positions": what the fit did not
/// see.
void add_verdict(HtmlReport& page, const calib::Verdict& verdict, std::string_view held_out,
                 int decimals = 2);

/// Where a model comes from, what `more` there is to say of it, and the files this report was made
/// from.
void add_model_origin(HtmlReport& page, const ModelDocument& document,
                      const std::vector<InputFile>& inputs,
                      const std::vector<std::pair<std::string, std::string>>& more = {});

}  // namespace abbe::daemon
