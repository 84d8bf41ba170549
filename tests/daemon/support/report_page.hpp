#pragma once
/// The data of the figures of a report, read from its HTML.

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon::test {

/// The value of an attribute in the tag that begins at `at`; empty without it.
inline std::string attribute(std::string_view page, std::size_t at, std::string_view name) {
  const std::string key = " " + std::string(name) + "=\"";
  const std::size_t end = page.find('>', at), from = page.find(key, at);
  if (from == std::string_view::npos || from > end) return {};
  const std::size_t begin = from + key.size();
  return std::string(page.substr(begin, page.find('"', begin) - begin));
}

/// Numbers separated by spaces; null for one that is not finite.
inline std::vector<nlohmann::json> numbers_of(const std::string& text) {
  std::vector<nlohmann::json> numbers;
  std::istringstream in(text);
  for (std::string word; in >> word;)
    numbers.push_back(word == "-" ? nlohmann::json() : nlohmann::json(std::stod(word)));
  return numbers;
}

/// All charts of the page in their order: {"title", "datasets": [{"label", "data": [{x, y, u}]}]}.
inline std::vector<nlohmann::json> charts_of(std::string_view page) {
  std::vector<nlohmann::json> charts;
  for (std::size_t at = 0; (at = page.find("<svg class=\"plot", at)) != std::string_view::npos;) {
    const std::size_t end = page.find("</svg>", at), title = page.find("<title>", at) + 7;
    nlohmann::json chart{{"title", page.substr(title, page.find('<', title) - title)},
                         {"datasets", nlohmann::json::array()}};
    while ((at = page.find("<g class=\"curve\"", at)) < end) {
      const auto x = numbers_of(attribute(page, at, "data-x")),
                 y = numbers_of(attribute(page, at, "data-y")),
                 u = numbers_of(attribute(page, at, "data-u"));
      nlohmann::json data = nlohmann::json::array();
      for (std::size_t i = 0; i < x.size(); ++i)
        data.push_back(
            {{"x", x[i]}, {"y", y.at(i)}, {"u", u.empty() ? nlohmann::json() : u.at(i)}});
      chart["datasets"].push_back({{"label", attribute(page, at, "data-name")}, {"data", data}});
      ++at;
    }
    charts.push_back(std::move(chart));
    at = end;
  }
  return charts;
}

/// The first chart whose title begins with `title`; null without one.
inline nlohmann::json chart_named(std::string_view page, std::string_view title) {
  for (auto& chart : charts_of(page))
    if (chart["title"].get<std::string>().starts_with(title)) return chart;
  return {};
}

/// The dataset whose label begins with `name`; null without one.
inline nlohmann::json dataset_of(const std::vector<nlohmann::json>& charts,
                                 const std::string& name) {
  for (const auto& chart : charts)
    for (const auto& dataset : chart["datasets"])
      if (dataset["label"].get<std::string>().starts_with(name)) return dataset;
  return {};
}

/// The values of the cells of each row of maps.
inline std::vector<std::vector<double>> maps_of(std::string_view page) {
  constexpr std::string_view kValue = "data-v=\"";
  std::vector<std::vector<double>> rows;
  for (std::size_t at = 0; (at = page.find("<svg class=\"maps\"", at)) != std::string_view::npos;) {
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
    const auto& datasets = chart["datasets"];
    if (datasets.empty() || !std::ranges::all_of(datasets, has_numbers)) return false;
  }
  for (const auto& values : maps)
    if (std::ranges::none_of(values, [](double v) { return v > 0.0; })) return false;
  return !charts.empty() && !maps.empty();
}

}  // namespace abbe::daemon::test
