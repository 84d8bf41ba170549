#pragma once
/// The state of a model of the store, for report and page.

#include <string>
#include <vector>

#include "abbe/report/html_report.hpp"
#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

/// A lamp, and words. Notes are no reasons against the model.
struct VerdictInWords {
  Signal signal = Signal::Unlit;
  std::string text;
  std::vector<std::string> reasons, notes;
};
[[nodiscard]] VerdictInWords verdict_in_words(const ReportSubject& subject);

}  // namespace abbe::daemon
