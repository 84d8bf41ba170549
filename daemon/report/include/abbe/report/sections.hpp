#pragma once
/// Sections that the reports of several methods have in common.

#include <string>
#include <utility>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// "12.35 um".
[[nodiscard]] std::string um_text(double length_m, int decimals = 2);

/// Adds the origin of a model, the additional rows `more`, and the input files of this report.
void add_model_origin(HtmlReport& page, const ModelDocument& document,
                      const std::vector<InputFile>& inputs,
                      const std::vector<std::pair<std::string, std::string>>& more = {});

}  // namespace abbe::daemon
