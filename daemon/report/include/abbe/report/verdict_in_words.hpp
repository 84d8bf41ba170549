#pragma once
/// The state of a stored model as a lamp and text, for report and page.

#include <string>
#include <vector>

#include "abbe/report/html_report.hpp"
#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

/// A lamp with its text. Notes in the text are no reasons against the model.
struct VerdictInWords {
  Signal signal = Signal::Unlit;
  std::string text;
  std::vector<std::string> reasons, notes;
};
[[nodiscard]] VerdictInWords verdict_in_words(const ReportSubject& subject);

}  // namespace abbe::daemon
