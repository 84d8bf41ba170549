// The figures of a report hold the numbers of the model and of the residuals.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "abbe/report/html_report.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/value_maps.hpp"
#include "report_page.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using calib::Axis;
using calib::Vector3;
using test::charts_of;
using test::dataset_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

calib::VolumetricModel with_interpolation(calib::Interpolation kind) {
  auto description = test::synthetic_model(3).description();
  description.interpolation = kind;
  return calib::VolumetricModel::from_description(std::move(description)).value();
}

/// Relative: the figures have nine digits.
constexpr double kShown = 1e-8;

std::size_t count(const std::string& text, std::string_view what) {
  std::size_t n = 0;
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += what.size()) ++n;
  return n;
}

HtmlReport page_of_tables(const calib::VolumetricModel& model) {
  HtmlReport page("tables");
  for (const LineChart& chart : table_line_charts(model)) page.plot(chart);
  return page;
}

TEST(Report, ATextCannotEndAnElementOrAnAttribute) {
  const std::string name = "\"></svg><script>alert(1)</script><!--<script>'&";
  HtmlReport page(name);
  page.heading(name);
  page.facts({{name, name}});
  page.plot(LineChart{.title = name,
                      .x_label = name,
                      .y_label = name,
                      .curves = {{.name = name, .x = {0.0, 1.0}, .y = {0.0, 1.0}}}});
  page.maps({.title = name,
             .x_label = name,
             .y_label = name,
             .scale_label = name,
             .maps = {{.title = name, .x_edges = {0, 1}, .y_edges = {0, 1}, .values = {1.0}}}});

  const std::string text = page.text();
  EXPECT_EQ(count(text, "<script"), 0u);
  EXPECT_EQ(count(text, "<!--"), 1u) << "the end of the plots";
  EXPECT_EQ(count(text, "</svg>"), 2u);
  const auto charts = charts_of(text);
  ASSERT_EQ(charts.size(), 1u);
  EXPECT_THAT(charts[0]["datasets"][0]["label"].get<std::string>(),
              ::testing::StartsWith("&quot;&gt;&lt;/svg&gt;"));
}

/// The dots are the nodes.
TEST(Report, TheChartsOfTheTablesHaveTheParametersOfTheModel) {
  const auto model = test::synthetic_model(3);
  const auto charts = charts_of(page_of_tables(model).text());
  std::set<std::pair<char, bool>> axes_and_kinds;  // EBX: rotation B of axis X
  for (const auto& p : model.parameters())
    if (p.position_m) axes_and_kinds.emplace(p.name.at(2), p.name.at(1) <= 'C');
  EXPECT_EQ(charts.size(), axes_and_kinds.size());

  for (const auto& p : model.parameters()) {
    if (!p.position_m) continue;
    bool found = false;
    const auto dataset = dataset_of(charts, p.name);
    for (std::size_t i = 0; i < dataset["data"].size(); ++i) {
      if (std::abs(dataset["data"][i]["x"].get<double>() - 1e3 * *p.position_m) > 1e-6) continue;
      found = true;
      EXPECT_NEAR(dataset["data"][i]["y"].get<double>(), 1e6 * p.value,
                  kShown * std::abs(1e6 * p.value))
          << p.name;
    }
    EXPECT_TRUE(found) << p.name;
  }
}

TEST(Report, TheBandsAreTheUncertaintiesOfTheModel) {
  const auto model = test::synthetic_model(3);
  const auto dataset = dataset_of(charts_of(page_of_tables(model).text()), "EXX");
  std::size_t node = 0;
  for (const auto& p : model.parameters()) {
    if (p.name != "EXX") continue;
    const std::size_t i = 6 * node++;  // six points in a cell
    EXPECT_NEAR(dataset["data"][i]["u"].get<double>(), 1e6 * p.u, kShown * 1e6 * p.u);
  }
  EXPECT_EQ(node, 5u);
}

/// Of a model in which all other tables are zero, V_x is EXX.
TEST(Report, ATableIsDrawnAsTheModelInterpolatesIt) {
  using calib::Interpolation;
  for (const auto kind : {Interpolation::Linear, Interpolation::NaturalCubic}) {
    auto description = with_interpolation(kind).description();
    for (auto& p : description.parameters)
      if (p.name != "EXX") p.value = 0.0;
    const auto model = calib::VolumetricModel::from_description(description).value();
    const auto dataset = dataset_of(charts_of(page_of_tables(model).text()), "EXX");
    ASSERT_EQ(dataset["data"].size(), 25u);
    for (const auto& point : dataset["data"]) {
      const Vector3 q(1e-3 * point["x"].get<double>(), 0.1, -0.2);
      EXPECT_NEAR(point["y"].get<double>(), 1e6 * model.V_at(q, model.tool_offsets_m().front()).x(),
                  1e-7);
    }
  }
}

/// Of a model in which only EXX is uncertain, the variance of V_x is that of EXX.
TEST(Report, TheBandsBetweenNodesAreTwoStandardUncertaintiesOfV) {
  using calib::Interpolation;
  for (const auto kind : {Interpolation::Linear, Interpolation::NaturalCubic}) {
    auto description = with_interpolation(kind).description();
    for (std::size_t i = 0; i < description.parameters.size(); ++i) {
      if (description.parameters[i].name == "EXX") continue;
      description.parameters[i].u = 0.0;
      description.covariance.row(static_cast<Eigen::Index>(i)).setZero();
      description.covariance.col(static_cast<Eigen::Index>(i)).setZero();
    }
    const auto model = calib::VolumetricModel::from_description(description).value();
    const auto dataset = dataset_of(charts_of(page_of_tables(model).text()), "EXX");
    ASSERT_EQ(dataset["data"].size(), 25u);  // five nodes, five points between two of them
    for (const auto& point : dataset["data"]) {
      const Vector3 q(1e-3 * point["x"].get<double>(), 0.1, -0.2);
      const auto e = model.error_at(q, model.tool_offsets_m().front());
      const double u_um = 1e6 * std::sqrt(e.cov_V_m2(0, 0));
      EXPECT_GT(u_um, 0.0);
      EXPECT_NEAR(point["u"].get<double>(), u_um, 1e-7);
    }
  }
}

TEST(Report, TheMapsHaveErrorAndUncertaintyOfTheModel) {
  const auto model = test::synthetic_model(3);
  HtmlReport page("maps");
  add_volume_maps(page, model);
  const auto maps = test::maps_of(page.text());
  ASSERT_EQ(maps.size(), 2u);  // before and after; nothing was held out
  const VolumeCuts cuts = volume_cuts(model.validity(), 20);
  ASSERT_EQ(cuts.across, Axis::Z);

  std::size_t i = 0;
  const auto middle = [](const std::vector<double>& e, std::size_t k) {
    return 0.5 * (e[k] + e[k + 1]);
  };
  for (std::size_t slab = 0; slab < 3; ++slab)
    for (std::size_t y = 0; y + 1 < cuts.y_edges_m.size(); ++y)
      for (std::size_t x = 0; x + 1 < cuts.x_edges_m.size(); ++x, ++i) {
        const auto e =
            model.error_at({middle(cuts.x_edges_m, x), middle(cuts.y_edges_m, y), cuts.cut_m(slab)},
                           model.tool_offsets_m().front());
        ASSERT_LT(i, maps[0].size());
        EXPECT_NEAR(maps[0][i], 1e6 * e.V_m.norm(), 1e-5 * maps[0][i]);
        EXPECT_NEAR(maps[1][i], 2e6 * std::sqrt(e.cov_V_m2.trace()), 1e-5 * maps[1][i]);
      }
  EXPECT_EQ(i, maps[0].size());
}

TEST(Report, TheMapOfHeldOutObservationsIsTheirRmsInACell) {
  HtmlReport page("maps");
  const Vector3 one(-0.29, -0.29, -0.39), other(0.29, 0.29, -0.11);
  const auto model = test::synthetic_model(3);
  add_volume_maps(
      page, model,
      held_out_cells(model.validity(), std::vector<LeftError>{{one, 20e-6, 3e-6, 1e-6},
                                                              {one, 20e-6, -4e-6, 1e-6},
                                                              {other, 20e-6, 2e-6, 1e-6}}));
  const auto maps = test::maps_of(page.text());
  ASSERT_EQ(maps.size(), 3u);
  ASSERT_EQ(maps[2].size(), 2u);
  EXPECT_NEAR(maps[2][0], std::sqrt(12.5), 1e-4);
  EXPECT_NEAR(maps[2][1], 2.0, 1e-4);
  EXPECT_THAT(page.text(), HasSubstr(fmt::format("{:.3f} um", std::sqrt(29.0 / 3.0))));
  EXPECT_THAT(page.text(), HasSubstr("3 observations, each predicted"));
}

TEST(Report, ACellThatTheMapDoesNotHaveIsLeftOut) {
  HtmlReport page("maps");
  const std::vector<RunFigures::HeldOutCell> changed{{.slab = 7, .cell = 0, .count = 1},
                                                     {.slab = 0, .cell = 1'000'000, .count = 1}};
  add_volume_maps(page, test::synthetic_model(3), changed);
  EXPECT_EQ(test::maps_of(page.text()).size(), 3u);
}

TEST(Report, TheMapsStateWhatTheyDoNotContain) {
  HtmlReport without("maps"), with("maps");
  const std::vector<LeftError> left{{Vector3(0.0, 0.0, -0.2), 20e-6, 3e-6, 1e-6}};
  add_volume_maps(without, test::synthetic_model(3));
  const auto model = test::synthetic_model(3);
  add_volume_maps(with, model, held_out_cells(model.validity(), left));
  const char* const removed = "shown without a rigid motion, which is fitted to these same";
  EXPECT_THAT(without.text(),
              AllOf(HasSubstr("left after compensation is below U(V) with 95 to 99 %"),
                    HasSubstr("U(V): |V| left is below it with 95 to 99 %"),
                    HasSubstr("of U(V) due to misfit"), HasSubstr("none found"),
                    Not(HasSubstr("to be expected")), HasSubstr("does not contain: lack of fit"),
                    HasSubstr("temperature"), Not(HasSubstr(removed))));
  EXPECT_THAT(with.text(), HasSubstr(removed));
}

std::string page_of(double chart_y, double map_value) {
  HtmlReport page("figures");
  page.plot(LineChart{.title = "t",
                      .x_label = "x",
                      .y_label = "y",
                      .curves = {{.name = "a", .x = {0.0, 1.0}, .y = {chart_y, chart_y}}}});
  page.maps(
      {.title = "t",
       .x_label = "x",
       .y_label = "y",
       .scale_label = "um",
       .maps = {{.title = "m", .x_edges = {0, 1}, .y_edges = {0, 1}, .values = {map_value}}}});
  return page.text();
}

TEST(Report, AFigureWithoutNumbersOrAMapOfZerosHasNoData) {
  EXPECT_TRUE(test::every_figure_has_data(page_of(1.0, 1.0)));
  EXPECT_FALSE(test::every_figure_has_data(page_of(std::nan(""), 1.0)));
  EXPECT_FALSE(test::every_figure_has_data(page_of(1.0, 0.0)));
  EXPECT_FALSE(test::every_figure_has_data(page_of(1.0, std::nan(""))));
}

TEST(Report, TheCutsAreAcrossTheShortestAxis) {
  std::vector<Vector3> corners;
  for (int i = 0; i < 8; ++i)
    corners.emplace_back((i & 1) != 0 ? 3.0 : 0.0, (i & 2) != 0 ? 0.02 : 0.0,
                         (i & 4) != 0 ? 0.5 : 0.0);
  const auto cuts = volume_cuts(calib::ValidityVolume::hull_of(corners).value(), 20);
  EXPECT_EQ(cuts.across, Axis::Y);
  EXPECT_EQ(cuts.x, Axis::X);
  EXPECT_EQ(cuts.y, Axis::Z);
  EXPECT_EQ(cuts.x_edges_m.size(), 21u);
  EXPECT_EQ(cuts.y_edges_m.size(), 5u);
  EXPECT_DOUBLE_EQ(cuts.cut_m(1), 0.01);
}

/// The outline of the bars has two points per interval, between a first and a last one.
TEST(Report, ADrawingHasALabelAtEveryEnd) {
  const Vector3 low(0, 0, -200), high(400, 300, 0);
  const std::string text = svg(SpaceDrawing{.title = "bars <1>",
                                            .box_mm = {low, high},
                                            .lines = {{"P1", low, {400, 0, -200}},
                                                      {"P2", {0, 0, 0}, {0, 300, 0}},
                                                      {"P3", {200, 300, 0}, {0, 300, 0}}}});
  EXPECT_THAT(text, HasSubstr("bars &lt;1&gt;"));
  EXPECT_THAT(text, HasSubstr(">P1</text>"));
  EXPECT_THAT(text, HasSubstr(">P2, P3</text>")) << "both end at the same place";
  EXPECT_EQ(count(text, "stroke-width"), 3u);
}

TEST(Report, AHistogramCountsEveryValue) {
  const std::vector<double> values{-1.9, -0.3, 0.1, 0.2, 0.25, 1.4};
  HtmlReport page("histogram");
  page.plot(Histogram{.title = "h", .x_label = "x", .series = {{"all", values}}, .bins = 4});
  const auto points = charts_of(page.text())[0]["datasets"][0]["data"];
  std::vector<double> counts;
  for (std::size_t i = 1; i + 1 < points.size(); i += 2) {
    counts.push_back(points[i]["y"]);
    EXPECT_LT(points[i]["x"].get<double>(), points[i + 1]["x"].get<double>());
  }
  EXPECT_THAT(counts, ::testing::ElementsAre(1, 1, 3, 1));  // -2, -1, 0, 1, 2
}

TEST(Report, TheNormalCurveOfAHistogramHasTheExpectedCounts) {
  HtmlReport page("histogram");
  std::vector<double> values(1000, 0.0);
  values.front() = -5.0;
  values.back() = 5.0;
  page.plot(Histogram{
      .title = "h", .x_label = "x", .series = {{"all", values}}, .bins = 20, .normal_sd = 2.0});
  double sum = 0.0, in_first_half_step = 0.0;
  const auto points = dataset_of(charts_of(page.text()), "normal distribution")["data"];
  for (const auto& point : points) {
    sum += point["y"].get<double>();
    if (point["x"] == 0.25) in_first_half_step = point["y"];
  }
  EXPECT_NEAR(sum, 1000.0 * (std::erf(2.75 / std::sqrt(2.0)) + std::erf(2.5 / std::sqrt(2.0))) / 2,
              1e-5);  // from -5 to 5.5
  EXPECT_NEAR(in_first_half_step, 500.0 * std::erf(0.25 / std::sqrt(2.0)), 1e-5);
}

// Chromium needed more than three minutes to print 928 hatched areas, one for each cell.
TEST(Report, AMapHatchesOneAreaForAllCellsWithoutAValue) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> edges{0.0, 1.0, 2.0};
  const ValueMap with_gaps{"gaps", edges, edges, {1.0, kNone, kNone, 2.0}};
  const ValueMap whole{"whole", edges, edges, {1.0, 2.0, 3.0, 4.0}};
  const std::string drawn = svg(ValueMaps{.title = "maps", .maps = {with_gaps, whole}});
  EXPECT_EQ(count(drawn, "url(#hatch)"), 1u);
  EXPECT_EQ(count(drawn, "data-v="), 6u);
}

}  // namespace
}  // namespace abbe::daemon
