#pragma once
/// A model as JSON for the page. Pure.

#include <nlohmann/json.hpp>

#include "abbe/report/model_report.hpp"

namespace abbe::web {

[[nodiscard]] nlohmann::json model_json(const daemon::ReportSubject& subject);

}  // namespace abbe::web
