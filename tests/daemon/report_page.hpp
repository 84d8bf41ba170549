#pragma once
/// The data of the figures of a report, read from its HTML.

#include <algorithm>
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

/// True if the page has charts and maps, every dataset of a chart has a number (a value that is not
/// finite is null in JSON), and every row of maps has a value that is not zero.
inline bool every_figure_has_data(std::string_view page) {
  const auto charts = charts_of(page);
  const auto maps = maps_of(page);
  const auto is_number = [](const nlohmann::json& point) { return point["y"].is_number(); };
  const auto has_numbers = [&is_number](const nlohmann::json& dataset) {
    return std::ranges::any_of(dataset["data"], is_number);
  };

  for (const auto& chart : charts) {
    const auto& datasets = chart["data"]["datasets"];
    if (datasets.empty() || !std::ranges::all_of(datasets, has_numbers)) return false;
  }
  for (const auto& values : maps)
    if (std::ranges::none_of(values, [](double v) { return v > 0.0; })) return false;
  return !charts.empty() && !maps.empty();
}

}  // namespace abbe::daemon::test
