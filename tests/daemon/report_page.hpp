#pragma once
/// The data of the figures of a report, read from its HTML.

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon::test {

/// The configurations of all charts, in the order of the page.
inline std::vector<nlohmann::json> charts_of(std::string_view page) {
  constexpr std::string_view kBegin = "<script>show(\"chart", kEnd = ")</script>";
  std::vector<nlohmann::json> charts;
  for (std::size_t at = 0; (at = page.find(kBegin, at)) != std::string_view::npos;) {
    const std::size_t from = page.find(',', at) + 1, to = page.find(kEnd, from);
    charts.push_back(nlohmann::json::parse(page.substr(from, to - from)));
    at = to;
  }
  return charts;
}

/// The dataset whose label begins with `name`; null without one.
inline nlohmann::json dataset_of(const std::vector<nlohmann::json>& charts,
                                 const std::string& name) {
  for (const auto& chart : charts)
    for (const auto& dataset : chart["data"]["datasets"])
      if (dataset["label"].get<std::string>().starts_with(name)) return dataset;
  return {};
}

/// The values of the cells of each row of maps.
inline std::vector<std::vector<double>> maps_of(std::string_view page) {
  constexpr std::string_view kValue = "data-v=\"";
  std::vector<std::vector<double>> rows;
  for (std::size_t at = 0; (at = page.find("<svg", at)) != std::string_view::npos;) {
    const std::size_t end = page.find("</svg>", at);
    auto& values = rows.emplace_back();
    while ((at = page.find(kValue, at)) < end) {
      at += kValue.size();
      values.push_back(std::stod(std::string(page.substr(at, page.find('"', at) - at))));
    }
    at = end;
  }
  return rows;
}

/// True if the page has charts and maps, every dataset of a chart has points, and every row of maps
/// has a value.
inline bool every_figure_has_data(std::string_view page) {
  const auto charts = charts_of(page);
  const auto maps = maps_of(page);
  for (const auto& chart : charts) {
    if (chart["data"]["datasets"].empty()) return false;
    for (const auto& dataset : chart["data"]["datasets"])
      if (dataset["data"].empty()) return false;
  }
  for (const auto& values : maps)
    if (values.empty()) return false;
  return !charts.empty() && !maps.empty();
}

}  // namespace abbe::daemon::test
