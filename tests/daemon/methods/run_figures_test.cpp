// What a model document keeps of the residuals of a run, recomputed from the residuals.
#include "abbe/methods/run_figures.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/methods/otf/document.hpp"
#include "abbe/report/model_report.hpp"
#include "otf_run.hpp"
#include "report_page.hpp"

namespace abbe::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<RunResidual> noise(std::size_t count) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0.0, 1e-6);
  std::vector<RunResidual> all;
  for (std::size_t i = 0; i < count; ++i)
    all.push_back({.part = i % 7,
                   .time_s = 0.01 * static_cast<double>(i),
                   .before_m = 10.0 * normal(random),
                   .after_m = normal(random),
                   .sigma_m = 1e-6});
  return all;
}

const std::vector<std::string> kSeven{"a", "b", "c", "d", "e", "f", "g"};

TEST(RunFigures, HaveTheFiguresOfEachPart) {
  const auto all = noise(1000);
  RunFigures run;
  add_residuals(run, "leg", kSeven, all);
  ASSERT_EQ(run.parts.size(), 7u);
  for (std::size_t part = 0; part < 7; ++part) {
    double squares = 0.0, largest = 0.0, first = 1e9, last = -1e9;
    std::size_t count = 0;
    for (const RunResidual& r : all) {
      if (r.part != part) continue;
      ++count;
      squares += r.after_m * r.after_m;
      largest = std::max(largest, std::abs(r.after_m));
      first = std::min(first, *r.time_s);
      last = std::max(last, *r.time_s);
    }
    const RunFigures::Part& p = run.parts[part];
    EXPECT_EQ(p.name, kSeven[part]);
    EXPECT_EQ(p.count, count);
    EXPECT_NEAR(p.after_rms_m, std::sqrt(squares / static_cast<double>(count)), 1e-18);
    EXPECT_EQ(p.after_max_m, largest);
    EXPECT_THAT(*p.time_s, ElementsAre(first, last));
  }
}

TEST(RunFigures, ALongSeriesKeepsItsOutliersAndIsBounded) {
  auto all = noise(50'000);
  all[12'345].after_m = 80e-6;
  all[40'001].after_m = -90e-6;
  RunFigures run;
  add_residuals(run, "leg", kSeven, all);
  const auto& points = run.series->points;
  EXPECT_TRUE(run.series->over_time);
  EXPECT_EQ(run.series->count, 50'000u);
  EXPECT_LE(points.size(), RunFigures::Series::kMostPoints);
  EXPECT_GT(points.size(), RunFigures::Series::kMostPoints / 2);
  EXPECT_TRUE(std::ranges::is_sorted(points, {}, &RunFigures::Series::Point::at));
  for (const std::size_t outlier : {12'345u, 40'001u})
    EXPECT_EQ(std::ranges::count(
                  points, RunFigures::Series::Point{*all[outlier].time_s, all[outlier].after_m}),
              1);
}

TEST(RunFigures, AShortSeriesHasEveryResidual) {
  const auto all = noise(2000);
  RunFigures run;
  add_residuals(run, "leg", kSeven, all);
  ASSERT_EQ(run.series->points.size(), 2000u);
  for (std::size_t i = 0; i < 2000; ++i) EXPECT_EQ(run.series->points[i].after_m, all[i].after_m);
}

TEST(RunFigures, WithoutTheTimeOfOneResidualTheSeriesIsOverTheirNumber) {
  auto all = noise(5);
  all[2].time_s.reset();
  RunFigures run;
  add_residuals(run, "leg", kSeven, all);
  EXPECT_FALSE(run.series->over_time);
  EXPECT_EQ(run.series->points.back().at, 5.0);
}

TEST(RunFigures, LeaveOutWhatIsNotFinite) {
  auto all = noise(14);
  all[3].after_m = std::nan("");
  all[10].before_m = std::nan("");  // both of part d
  RunFigures run;
  add_residuals(run, "leg", kSeven, all);
  EXPECT_EQ(run.series->count, 12u);
  EXPECT_EQ(run.parts.size(), 6u);
  RunFigures none;
  add_residuals(none, "leg", {}, {});
  EXPECT_FALSE(none.series);
}

TEST(RunFigures, CountResidualsInStandardUncertainties) {
  std::vector<RunResidual> all;
  for (const double after_m : {-9e-6, -0.1e-6, 0.1e-6, 0.2e-6, 9e-6})
    all.push_back({.after_m = after_m, .sigma_m = 1e-6});
  RunFigures run;
  add_residuals(run, "leg", {"a"}, all);
  const std::size_t middle = RunFigures::kSigmaIntervals / 2;
  EXPECT_EQ(run.sigma_counts.front(), 1u);
  EXPECT_EQ(run.sigma_counts[middle - 1], 1u);
  EXPECT_EQ(run.sigma_counts[middle], 2u);
  EXPECT_EQ(run.sigma_counts.back(), 1u);
  all.front().sigma_m = 0.0;  // not known
  add_residuals(run, "leg", {"a"}, all);
  EXPECT_TRUE(run.sigma_counts.empty());
}

TEST(RunFigures, CombineNeighboursOfVeryManyParts) {
  std::vector<std::string> names;
  std::vector<RunResidual> all;
  for (std::size_t i = 0; i < 2500; ++i) {
    names.push_back(fmt::format("leg {}", i + 1));
    all.push_back({.part = i, .after_m = 1e-6});
  }
  RunFigures run;
  add_residuals(run, "leg", names, all);
  EXPECT_LE(run.parts.size(), kMostParts);
  EXPECT_EQ(run.parts.front().name, "leg 1 to leg 3");
  EXPECT_EQ(run.parts.back().name, "leg 2500");
}

/// A run on the fly that was identified and judged.
struct Identified {
  calib::otf::Identification found;
  OtfCandidate candidate;
};

Identified identified() {
  namespace otf = tests::otf;
  const otf::MadeRun run = otf::make_run({});
  auto found = *calib::otf::identify(run.samples, run.machine, run.path, run.noise, run.options);
  std::vector<RunResiduals> residuals{
      calib::otf::placed_residuals(found.observations, found.solution.residuals)};
  auto verdict = *calib::otf::judge(found.observations, found.solution, nullptr, {}, run.options,
                                    calib::otf::held_out_into(residuals));
  OtfCandidate candidate{found.solution, std::move(verdict), calib::otf::Mode::OnTheFly,
                         std::move(residuals)};
  return {std::move(found), std::move(candidate)};
}

TEST(RunFiguresOtf, AreThoseOfTheRowsOfTheRun) {
  const Identified run = identified();
  const ModelDocument document = otf_document(run.candidate, {}, {}, {});
  const auto& rows = run.found.observations.rows;
  const auto& after_m = run.found.solution.residuals.after_m;
  const auto& segment_s = run.found.observations.segment_s;
  double begin_s = 1e9, end_s = -1e9;
  for (const auto& row : rows) {
    begin_s = std::min(begin_s, segment_s.at(row.segment));
    end_s = std::max(end_s, segment_s.at(row.segment));
  }

  std::size_t all = 0;
  double squares = 0.0;
  for (const RunFigures::Part& part : document.run->parts) {
    double of_leg = 0.0, largest = 0.0, first = 1e9, last = -1e9;
    std::size_t count = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (part.name != fmt::format("leg {}", rows[i].leg + 1)) continue;
      ++count;
      of_leg += after_m[i] * after_m[i];
      largest = std::max(largest, std::abs(after_m[i]));
      first = std::min(first, segment_s[rows[i].segment] - begin_s);
      last = std::max(last, segment_s[rows[i].segment] - begin_s);
    }
    EXPECT_EQ(part.count, count) << part.name;
    EXPECT_NEAR(part.after_rms_m, std::sqrt(of_leg / static_cast<double>(count)), 1e-15);
    EXPECT_EQ(part.after_max_m, largest);
    EXPECT_NEAR((*part.time_s)[0], first, 1e-9);
    EXPECT_NEAR((*part.time_s)[1], last, 1e-9);
    all += count;
    squares += of_leg;
  }
  EXPECT_EQ(all, rows.size());
  EXPECT_NEAR(document.statistics.after.rms_m, std::sqrt(squares / static_cast<double>(all)),
              1e-12);
  EXPECT_NEAR(*document.run->conditions->duration_s, end_s - begin_s, 1e-9);
  EXPECT_NEAR(*document.run->conditions->feed_m_per_s, tests::otf::MadeRunOptions{}.speed_m_s,
              0.01 * tests::otf::MadeRunOptions{}.speed_m_s);
}

TEST(RunFiguresOtf, TheSeriesHasTheResidualOfEachRowAtTheTimeOfItsSegment) {
  const Identified run = identified();
  const ModelDocument document = otf_document(run.candidate, {}, {}, {});
  const auto& o = run.found.observations;
  const RunFigures::Series& series = *document.run->series;
  EXPECT_TRUE(series.over_time);
  EXPECT_EQ(series.count, o.rows.size());
  double begin_s = 1e9;
  for (const auto& row : o.rows) begin_s = std::min(begin_s, o.segment_s[row.segment]);
  for (const auto& point : series.points) {
    bool found = false;
    for (std::size_t i = 0; i < o.rows.size() && !found; ++i)
      found = run.found.solution.residuals.after_m[i] == point.after_m &&
              std::abs(o.segment_s[o.rows[i].segment] - begin_s - point.at) < 1e-9;
    EXPECT_TRUE(found) << point.at;
  }
}

TEST(RunFiguresOtf, TheHeldOutCellsHaveTheObservationsOfTheVerdict) {
  const Identified run = identified();
  const ModelDocument document = otf_document(run.candidate, {}, {}, {});
  double squares = 0.0;
  std::size_t count = 0;
  for (const auto& cell : document.run->held_out_cells) {
    count += cell.count;
    squares += static_cast<double>(cell.count) * cell.after_m * cell.after_m;
  }
  EXPECT_EQ(count, run.candidate.verdict.held_out.observations);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(count)),
              run.candidate.verdict.held_out.candidate_rms_m, 1e-12);
}

/// The page at the identification, and the page made from the text of model.json.
TEST(RunFiguresOtf, TheReportIsTheSameFromTheStoredText) {
  const Identified run = identified();
  ReportSubject subject{.document = otf_document(run.candidate, {}, {{"points", "00ff"}}, {})};
  subject.entry = StoreEntry{.id = model_id(subject.document), .accepted = true, .reasons = {}};
  const std::string page = model_report(subject).value();
  subject.document = parse_model(to_json(subject.document), "model.json").value();
  EXPECT_EQ(page, model_report(subject).value());

  const RunFigures& figures = *subject.document.run;
  const auto chart = test::chart_named(page, "Residuals of the fit over time");
  ASSERT_FALSE(chart.is_null());
  const auto& data = chart["datasets"][0]["data"];
  ASSERT_EQ(data.size(), figures.series->points.size());
  for (std::size_t i = 0; i < data.size(); ++i) {
    EXPECT_NEAR(data[i]["x"].get<double>(), figures.series->points[i].at, 1e-6);
    EXPECT_NEAR(data[i]["y"].get<double>(), 1e6 * figures.series->points[i].after_m, 1e-8);
  }
  const auto by_leg = test::chart_named(page, "Residuals by leg");
  ASSERT_EQ(by_leg["datasets"][0]["data"].size(), figures.parts.size());
  for (std::size_t i = 0; i < figures.parts.size(); ++i) {
    const double rms_um = by_leg["datasets"][0]["data"][i]["y"],
                 largest_um = by_leg["datasets"][1]["data"][i]["y"];
    EXPECT_NEAR(rms_um, 1e6 * figures.parts[i].after_rms_m, 1e-8);
    EXPECT_NEAR(largest_um, 1e6 * figures.parts[i].after_max_m, 1e-8);
  }
  const auto& worst = *std::ranges::max_element(figures.parts, {}, &RunFigures::Part::after_rms_m);
  EXPECT_THAT(page, HasSubstr(fmt::format("<td>{}</td><td>{}</td><td>{:.3f}</td><td>{:.3f}</td>"
                                          "<td>{:.3f}</td><td>{:.1f} to {:.1f}</td>",
                                          worst.name, worst.count, 1e6 * worst.before_rms_m,
                                          1e6 * worst.after_rms_m, 1e6 * worst.after_max_m,
                                          (*worst.time_s)[0], (*worst.time_s)[1])));
  EXPECT_THAT(page, HasSubstr(fmt::format("{:.0f} mm/min, median over the legs",
                                          60e3 * *figures.conditions->feed_m_per_s)));
}

}  // namespace
}  // namespace abbe::daemon
