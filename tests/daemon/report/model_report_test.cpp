// Reports from a stored model: the same bytes, the numbers of the model, hostile names.
#include "abbe/report/model_report.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "abbe/base/units.hpp"
#include "abbe/report/line_plot.hpp"
#include "report_page.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::size_t times(const std::string& text, std::string_view what) {
  std::size_t n = 0;
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += what.size()) ++n;
  return n;
}

ReportSubject reported(unsigned seed, bool accepted = true) {
  ReportSubject subject{.document = test::synthetic_document(seed)};
  subject.entry = StoreEntry{
      .id = model_id(subject.document), .active = accepted, .accepted = accepted, .reasons = {}};
  if (!accepted) subject.entry->reasons = {"held out: no better than no compensation"};
  subject.document.verdict = ModelVerdict{accepted, subject.entry->reasons};
  subject.events.push_back({.action = StoreAction::Added,
                            .id = subject.entry->id,
                            .actor = {"turner", "", subject.document.created},
                            .accepted = accepted});
  return subject;
}

const CertifiedValue& certified_value(const CertifiedValues& values, std::string_view key) {
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& value : group.values)
      if (value.key == key) return value;
  ADD_FAILURE() << "no value " << key;
  return values.groups.front().values.front();
}

TEST(CertifiedValues, AreTheRoundedValuesOfTheModel) {
  const ModelDocument document = test::synthetic_document(3);
  const auto values = certified_values(document).value();
  const auto standard = calib::iso::standard_values(document.model).value();
  const CertifiedValue& M = certified_value(values, "X.M");
  // Half a unit of the last decimal, with two significant digits of U.
  const double U_um = 2.0 * kUmPerM * standard.positioning[0].M.u;
  const double last = std::pow(10.0, std::floor(std::log10(U_um)) - 1.0);
  EXPECT_NEAR(std::stod(M.value), kUmPerM * standard.positioning[0].M.value, 0.501 * last);
  EXPECT_NEAR(std::stod(M.U), U_um, 0.501 * last);
  EXPECT_EQ(M.value.size() - M.value.find('.'), M.U.size() - M.U.find('.')) << M.value << M.U;
  EXPECT_TRUE(certified_value(values, "EC0Y").is_angle);
  EXPECT_TRUE(certified_value(values, "X.B").value.empty());
  EXPECT_THAT(certified_value(values, "X.B").why, HasSubstr("directions of travel"));
}

TEST(CertifiedValues, OfAModelWithTravelContainTheReversalError) {
  ModelDocument document = test::synthetic_document(3);
  document.model = test::synthetic_travel_model(3);
  const auto values = certified_values(document).value();
  EXPECT_FALSE(certified_value(values, "X.B").value.empty());
  EXPECT_FALSE(certified_value(values, "PPP.B").value.empty());
  EXPECT_NEAR(std::stod(certified_value(values, "EXX.backlash").value), 7.0 / 3.0, 0.01);
}

TEST(ModelReport, IsTheSameForTheSameModelAndNeedsNoScript) {
  const std::string page = model_report(reported(3)).value();
  const auto again = parse_model(to_json(test::synthetic_document(3)), "model.json").value();
  ReportSubject read = reported(3);
  read.document = again;
  EXPECT_EQ(page, model_report(read).value());
  EXPECT_NE(page, model_report(reported(4)).value());
  EXPECT_THAT(page, AllOf(Not(HasSubstr("<script")), Not(HasSubstr("<canvas"))));
}

TEST(ModelReport, HasTheVerdictFirstAndEverythingThatIsSigned) {
  const ReportSubject subject = reported(3);
  const std::string page = model_report(subject).value();
  const auto values = certified_values(subject.document).value();
  EXPECT_LT(page.find("Green: the gate accepted"), page.find("Volumetric error"));
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& v : group.values)
      EXPECT_THAT(page, HasSubstr(v.value.empty() ? v.key : "<td>" + v.value + "</td>")) << v.key;
  EXPECT_THAT(page,
              AllOf(HasSubstr("reference axis X"), HasSubstr("What the uncertainty does not"),
                    HasSubstr("ECY, EAZ, EBZ, ECZ: with one tool offset"), HasSubstr("turner"),
                    HasSubstr("20.0, -15.0, -120.0 mm"), HasSubstr("11ee"), HasSubstr("Signature"),
                    HasSubstr(model_hash(subject.document))));
}

TEST(ModelReport, HasOneParagraphForAllThatIsNotEstimable) {
  const std::string page = model_report(reported(3)).value();
  EXPECT_EQ(times(page, "<td>not estimable</td>"), 0u);
  EXPECT_EQ(times(page, "<p>Not estimable: "), 1u);
  const auto from = page.find("<p>Not estimable: ");
  const std::string paragraph = page.substr(from, page.find("</p>", from) - from);
  for (const char* const key : {"X.E", "X.B", "Z.B", "PPP.E", "NNP.B", "E_d"})
    EXPECT_THAT(paragraph, HasSubstr(key));
  EXPECT_EQ(times(paragraph, "no differences between the directions of travel"), 1u);
}

/// The text of the first page.
std::string front_of(const ReportSubject& subject) {
  const std::string page = model_report(subject).value();
  return page.substr(0, page.find("class=\"page\""));
}

TEST(ModelReport, TheFirstPageNamesTheKeyOfWhatIsNotKnown) {
  EXPECT_THAT(front_of(reported(3)),
              AllOf(HasSubstr("<td>not stated (machine.serial)</td>"),
                    HasSubstr("<td>not stated (certificate.number)</td>"),
                    HasSubstr("<td>not stated (customer.name)</td>"),
                    HasSubstr("<td>not known (conditions.temperature_C)</td>"),
                    HasSubstr("equipment.serial"), HasSubstr("[[tolerance]]"),
                    HasSubstr("neither pass nor fail"), HasSubstr("Signature"),
                    HasSubstr("<td>turner</td>")));
}

TEST(ModelReport, TheFirstPageHasWhatIsKnownTheWorstAxisAndThePicture) {
  ReportSubject subject = reported(3);
  CertificateDetails& d = subject.details;
  d.machine_serial = "600-0815";
  d.number = "2026-0117";
  d.customer.name = "Example Machining";
  d.person = "E. Abbe";
  d.temperature_C = 20.4;
  d.equipment = {{.name = "tracker", .serial = "4711"}};
  const std::string front = front_of(subject);
  EXPECT_THAT(front, AllOf(HasSubstr("600-0815"), HasSubstr("2026-0117"), HasSubstr("E. Abbe"),
                           HasSubstr("Example Machining"), HasSubstr("20.40 C"),
                           HasSubstr("tracker 4711"), HasSubstr("before: |V|")));
  const auto standard = calib::iso::standard_values(subject.document.model).value();
  double largest_m = 0.0;
  char worst = '?';
  const auto take = [&](double range_m, calib::Axis axis) {
    if (range_m <= largest_m) return;
    largest_m = range_m;
    worst = letter(axis);
  };
  for (const auto& p : standard.positioning) take(p.M.value, p.axis);
  for (const auto& s : standard.straightness)
    if (s.range.in_model) take(s.range.value, s.motion.axis);
  EXPECT_THAT(front, HasSubstr(std::string("worst axis: ") + worst));
}

TEST(ModelReport, TheFirstPageHasTheVerdictOnTheLimits) {
  ReportSubject subject = reported(3);
  subject.details.tolerances = {{.value = "X.M", .limit_um_urad = 1e6}};
  EXPECT_THAT(front_of(subject), AllOf(HasSubstr("Pass: every value"), HasSubstr("1e+06 um"),
                                       HasSubstr("<td>pass</td>")));
  subject.details.tolerances.push_back({.value = "Y.M", .limit_um_urad = 1e-3});
  EXPECT_THAT(front_of(subject), HasSubstr("Fail: a value is beyond its limit."));
  subject.details.tolerances = {{.value = "X.nothing", .limit_um_urad = 1.0}};
  EXPECT_EQ(model_report(subject).error().code, ErrorCode::BadInput);
}

TEST(ModelReport, EachSheetHasTheHashOfTheModelAndItsNumber) {
  const ReportSubject subject = reported(3);
  const std::string page = model_report(subject).value();
  const std::string style = page.substr(0, page.find("</style>"));
  EXPECT_THAT(style, AllOf(HasSubstr(model_hash(subject.document)), HasSubstr("counter(pages)")));
}

TEST(ModelReport, LongReasonsGoOnOnTheSecondPage) {
  ReportSubject subject = reported(3, false);
  auto& reasons = subject.document.verdict->reasons;
  for (int i = 0; i < 30; ++i) reasons.push_back(std::string(80, 'r') + std::to_string(i));
  const std::string front = front_of(subject);
  EXPECT_THAT(front, AllOf(HasSubstr("more reasons and notes are on the next page"),
                           HasSubstr("Signature"), Not(HasSubstr("r29"))));
  EXPECT_THAT(model_report(subject).value(), HasSubstr("r29"));
}

TEST(ModelReport, StatesReasonsAndNotesApart) {
  ReportSubject refused = reported(3, false);
  refused.document.recording_gap = "the disk was full";
  refused.events.push_back({.action = StoreAction::Forced,
                            .id = refused.entry->id,
                            .actor = {"foreman", "parts are waiting", {}}});
  const std::string page = model_report(refused).value();
  EXPECT_THAT(page, HasSubstr("Red: the gate refused"));
  const auto reasons = page.find("Reasons:"), notes = page.find("To know about this model:");
  ASSERT_NE(reasons, std::string::npos);
  ASSERT_NE(notes, std::string::npos);
  EXPECT_LT(reasons, page.find("held out: no better"));
  EXPECT_LT(page.find("held out: no better"), notes);
  EXPECT_LT(notes, page.find("against the verdict by foreman"));
  EXPECT_LT(notes, page.find("no replay can check this model: the disk was full"));

  ReportSubject drifted = reported(3);
  drifted.events.push_back({.action = StoreAction::Drifted,
                            .id = drifted.entry->id,
                            .actor = {"abbed", "EXX changed", {}}});
  EXPECT_THAT(model_report(drifted).value(), HasSubstr("Yellow: accepted, but"));
  drifted.entry.reset();
  drifted.document.verdict.reset();
  EXPECT_THAT(model_report(drifted).value(), HasSubstr("No verdict"));
}

TEST(ModelReport, OfAModelThatWasNotJudgedIsNotRed) {
  ReportSubject subject = reported(3);
  subject.document.verdict.reset();
  subject.entry->judged = subject.entry->accepted = false;
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("No verdict"), Not(HasSubstr("Red: the gate"))));
}

TEST(ModelReport, OfAnEarlierVersionIsGreenWhereItWasAccepted) {
  ReportSubject subject = reported(3);
  subject.machine_hash = "present";
  EXPECT_THAT(model_report(subject).value(), HasSubstr("for another machine configuration"));
  subject.events.push_back({.action = StoreAction::Activated,
                            .id = subject.entry->id,
                            .actor = {"foreman", "checked", {}}});
  subject.events.back().accepted_configuration = "present";
  EXPECT_THAT(model_report(subject).value(), HasSubstr("Green: the gate accepted"));
}

TEST(ModelReport, StatesTimesThatContradictEachOther) {
  ReportSubject subject = reported(3);
  subject.details.now = subject.document.created - std::chrono::hours{48};
  EXPECT_THAT(model_report(subject).value(), HasSubstr("which is in the future"));
}

TEST(ModelReport, HasTheResidualsOfTheRunAndTheNotesOfItsVerdict) {
  ReportSubject subject = reported(3);
  EXPECT_THAT(model_report(subject).value(), HasSubstr("<p>Not recorded.</p>"));
  subject.document.run = RunFigures{.held_out = "legs",
                                    .held_out_before_m = 12.5e-6,
                                    .held_out_after_m = 0.25e-6,
                                    .notes = {"the air was not measured"},
                                    .residuals = {{0.5, 1e-5, 1e-7}, {1.5, 2e-5, 2e-7}},
                                    .places_m = {{{-0.2, 0.1, -0.3}, {0.2, 0.1, -0.2}}}};
  subject.document.software = "0.0.7-earlier";
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("12.500 um rms"), HasSubstr("0.250 um rms"), HasSubstr("at legs"),
                    HasSubstr("Residuals of the fit along the path, rms, after"),
                    HasSubstr("Where was measured"), HasSubstr("the driven path"),
                    HasSubstr("abbe 0.0.7-earlier; this report: abbe "),
                    HasSubstr("<li>the air was not measured</li>")));
}

TEST(ModelReport, OfAModelOfAnEarlierVersionStatesWhatIsNotRecorded) {
  ReportSubject subject = reported(3);
  const auto with_run = [](std::vector<RunFigures::Interval> residuals) {
    return RunFigures{.held_out = "legs", .residuals = std::move(residuals)};
  };
  const std::string before_runs = model_report(subject).value();
  EXPECT_EQ(times(before_runs, "Not recorded."), 2u) << "where was measured, residuals";
  EXPECT_EQ(times(before_runs, "not recorded"), 3u) << "temperature, feed, measuring time";

  subject.document.run = with_run({{0.5, 1e-5, 1e-7}});
  subject.document = parse_model(to_json(subject.document), "model.json").value();
  const std::string before_parts = model_report(subject).value();
  EXPECT_EQ(times(before_parts, "Not recorded."), 1u) << "where was measured";
  EXPECT_THAT(before_parts, HasSubstr("Residuals of the fit along the path, rms, after"));
  subject.document.run = with_run({});
  EXPECT_EQ(times(model_report(subject).value(), "Not recorded."), 2u);
}

TEST(ModelReport, StatesWhetherTheDevicesWereSimulatedAndWhatMeasured) {
  ReportSubject subject = reported(3);
  EXPECT_THAT(model_report(subject).value(), HasSubstr("not known whether they were simulated"));
  auto& configuration = subject.document.configuration.emplace();
  set_entry(configuration.readings, "daemon.simulated", "true");
  set_entry(configuration.measurements, "tracker.reflector", "ball 1.5");
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("SIMULATED"), HasSubstr("tracker.reflector = ball 1.5")));
}

/// Its statistics are those of the held-out test: rms only, no samples.
TEST(ModelReport, OfAJointModelDoesNotPresentTheHeldOutTestAsResidualsOfAFit) {
  ReportSubject subject = reported(3);
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("<td>before the fit</td>"), HasSubstr("<td>1000, 3 lost</td>")));
  subject.document.method = subject.document.estimator = "joint";
  subject.document.run =
      RunFigures{.held_out = "legs", .held_out_before_m = 12.5e-6, .residuals = {}};
  const std::string page = model_report(subject).value();
  EXPECT_THAT(page, AllOf(Not(HasSubstr("before the fit")), Not(HasSubstr(" lost</td>")),
                          Not(HasSubstr("sigma0")), HasSubstr("held-out legs: rms and mean square"),
                          HasSubstr("no residuals of its own"), HasSubstr("12.500 um rms")));
}

TEST(ModelReport, OfAnUpdateStatesWhoseResidualsItHas) {
  ReportSubject subject = reported(3);
  subject.document.run = RunFigures{.residuals = {{0.5, 1e-5, 1e-7}}, .of_model = "00c0ffee"};
  subject.document = parse_model(to_json(subject.document), "model.json").value();
  const std::string page = model_report(subject).value();
  EXPECT_EQ(times(page, "those of the model of the run alone, 00c0ffee"), 3u)
      << "figures, residuals, statistics";
}

TEST(ModelReport, StatesAGapOfTheRecordingOnce) {
  ReportSubject subject = reported(3);
  subject.document.recording_gap = "the disk was full";
  subject.document.run =
      RunFigures{.notes = {cannot_be_checked("the disk was full")}, .residuals = {}};
  EXPECT_EQ(times(model_report(subject).value(), "<li>no replay can check this model"), 2u)
      << "in the notes, and in what the uncertainty does not contain";
}

TEST(ModelReport, TheTemperatureOfTheBallArrayIsNotThatOfSensors) {
  ReportSubject subject = reported(3);
  subject.document.method = "evemu";
  subject.document.artefact = calib::Expansion{11.5e-6, 0.5e-6, 293.65, 0.1};
  subject.document.run = RunFigures{.residuals = {}};
  subject.document.run->conditions =  // as earlier versions wrote it
      RunConditions{.temperature_K = std::array{293.65, 293.65}};
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("<th>temperature</th><td>not recorded</td>"),
                    HasSubstr("<th>temperature of the ball array</th><td>20.50 \u00b1 0.20 C")));
}

TEST(ModelReport, TheTimeOfSeveralRunsHasNoPauses) {
  ReportSubject subject = reported(3);
  subject.document.run = RunFigures{.residuals = {}, .places_m = {{{-0.2, 0.1, -0.3}}}};
  subject.document.run->conditions = RunConditions{.duration_s = 100.0};
  EXPECT_THAT(model_report(subject).value(),
              HasSubstr("<td>100.0 s, from the first to the last observation</td>"));
  subject.document.run->places_m.push_back({{0.2, 0.1, -0.3}});
  EXPECT_THAT(model_report(subject).value(),
              HasSubstr("<td>100.0 s, sum of the runs, without the pauses between them</td>"));
}

/// The page with as many residuals in each interval; of 200 observations, 160 degrees of freedom.
std::string page_with_sigma_counts(const std::string& method, std::optional<double> freedom) {
  ReportSubject subject = reported(3);
  subject.document.method = method;
  subject.document.statistics.degrees_of_freedom = freedom;
  subject.document.run = RunFigures{.residuals = {}};
  RunFigures& run = *subject.document.run;
  run.part_kind = "measurement";
  run.parts = {{"m1", 200, 1e-5, 1e-6, 1e-6, std::nullopt}};
  run.series = ResidualSeries{1, false, {{1.0, 1e-6}}};
  run.sigma_counts = std::vector<std::size_t>(RunFigures::kSigmaIntervals, 5);
  subject.document = parse_model(to_json(subject.document), "model.json").value();
  return model_report(subject).value();
}

/// A fit of a bar has unknowns with a prior (rank 70), which take only a part of a freedom.
TEST(ModelReport, PredictsTheResidualsFromTheDegreesOfFreedom) {
  const auto chart = test::chart_named(page_with_sigma_counts("mfb", 160.0),
                                       "Residuals in standard uncertainties");
  const auto predicted = test::dataset_of({chart}, "as predicted");
  ASSERT_FALSE(predicted.is_null());
  // 200 values, sd = sqrt(160 / 200), in the interval from 0 to 0.25.
  const double expected = 100.0 * std::erf(0.25 / std::sqrt(2.0 * 0.8));
  EXPECT_NEAR(predicted["data"][RunFigures::kSigmaIntervals / 2]["y"].get<double>(), expected,
              1e-4);
}

TEST(ModelReport, PredictsNoResidualsWithoutTheDegreesOfFreedomOrFromEstimatedNoise) {
  const auto has_prediction = [](const std::string& page) {
    return !test::dataset_of(test::charts_of(page), "as predicted").is_null();
  };
  EXPECT_FALSE(has_prediction(page_with_sigma_counts("mfb", std::nullopt))) << "earlier version";
  EXPECT_TRUE(has_prediction(page_with_sigma_counts("otf", std::nullopt))) << "has no priors";
  const std::string array = page_with_sigma_counts("evemu", 160.0);
  EXPECT_FALSE(has_prediction(array));
  EXPECT_THAT(array, HasSubstr("no predicted distribution"));
}

TEST(ModelReport, HasTheTablesOfTheMethod) {
  ReportSubject subject = reported(3);
  subject.document.run = RunFigures{.residuals = {}};
  subject.document.run->tables = {{"Parts <1>", "why", {"part", "u"}, {{"front", "0.25 um"}}},
                                  {"Choice", "", {}, {{"lambda", "0.125"}, {"damaged"}}}};
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("<h2>Parts &lt;1&gt;</h2>"), HasSubstr("<td>0.25 um</td>"),
                    HasSubstr("<th>lambda</th><td>0.125</td>"), Not(HasSubstr("damaged"))));
}

TEST(ModelReport, EscapesNamesOfMachinePeopleAndFiles) {
  const std::string name = "</td><script>alert(1)</script>\"'&\xff";
  ReportSubject subject = reported(3, false);
  subject.document.machine = subject.document.estimator = subject.document.mode = name;
  subject.document.recording_gap = name;
  subject.document.inputs = {{name, name}};
  subject.entry->reasons = {name};
  subject.document.run = RunFigures{.notes = {name}, .residuals = {}};
  subject.document.run->part_kind = name;
  subject.document.run->parts = {{name, 1, 1e-5, 1e-6, 1e-6, std::nullopt}};
  subject.document.run->series = ResidualSeries{1, true, {{0.0, 1e-6}}};
  subject.document.run->tables = {{name, name, {name}, {{name}}}};
  subject.events.front().actor = {name, name, {}};
  CertificateDetails& d = subject.details;
  d.number = d.remark = d.person = d.role = d.machine_serial = d.laboratory.name = name;
  d.customer.street = name;
  d.equipment = {{name, name, name, name, name}};
  for (const auto& page :
       {model_report(subject).value(), comparison_report(subject, subject).value(),
        trend_report({subject, subject}).value()})
    EXPECT_EQ(times(page, "<script"), 0u);
}

TEST(ComparisonReport, HasBothModelsAndTheirDifference) {
  const ReportSubject a = reported(3), b = reported(4);
  const std::string page = comparison_report(a, b).value();
  const auto values_a = certified_values(a.document).value(),
             values_b = certified_values(b.document).value();
  const CertifiedValue& A = certified_value(values_a, "EC0Y");
  const CertifiedValue& B = certified_value(values_b, "EC0Y");
  EXPECT_THAT(page, AllOf(HasSubstr(A.value + " \u00b1 " + A.U + " urad"),
                          HasSubstr(B.value + " \u00b1 " + B.U + " urad"),
                          HasSubstr(model_id(a.document)), HasSubstr(model_id(b.document))));
  EXPECT_NE(page, comparison_report(b, a).value());

  ReportSubject other = b;  // valid for another tool only
  auto description = b.document.model.description();
  description.tool_offsets_m = {{0.3, 0.0, 0.0}};
  other.document.model = calib::VolumetricModel::from_description(description).value();
  const auto refused = comparison_report(a, other);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("not valid for it"));
}

TEST(TrendReport, IsInTheOrderOfTimeAndLeavesRefusedModelsOutOfTheCharts) {
  std::vector<ReportSubject> models{reported(3), reported(4, false), reported(5)};
  models[0].document.created += std::chrono::hours(48);
  models[1].document.created += std::chrono::hours(24);
  const std::string page = trend_report(models).value();
  EXPECT_LT(page.find(model_id(models[2].document)), page.find(model_id(models[1].document)));
  EXPECT_LT(page.find(model_id(models[1].document)), page.find(model_id(models[0].document)));
  EXPECT_THAT(page, AllOf(HasSubstr("Models: 3."), HasSubstr("<td>red</td>"),
                          HasSubstr("<td>identified 2024-05-17T08:30</td>")));
  const auto plots = page.substr(page.find("class=\"plots\""));
  const std::size_t angular = certified_values(models[0].document)->standard.angular.size();
  EXPECT_GT(angular, 0u);
  EXPECT_EQ(times(plots, "<circle"), 2u * (3 + 6 + 3 + angular + 4))
      << "two models: M and straightness of three axes, squareness, angular errors, diagonals";
  EXPECT_FALSE(trend_report({}));
}

RunFigures measured_at(protocol::UtcTime first, protocol::UtcTime last) {
  RunFigures run{.residuals = {}};
  run.conditions = RunConditions{.measured = std::array{first, last}};
  return run;
}

/// A recording that is identified again later: the date of the measurement is that of the
/// recording.
TEST(ModelReport, StatesWhenWasMeasuredAndWhenItWasIdentified) {
  ReportSubject subject = reported(3);
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("<th>identified (UTC)</th><td>2024-05-17T08:30:00."),
                    Not(HasSubstr("measured (UTC)"))));
  const auto day = std::chrono::hours(24);
  const auto last = subject.document.created - 15 * day;
  subject.document.run = measured_at(last - std::chrono::minutes(20), last);
  EXPECT_THAT(model_report(subject).value(),
              AllOf(HasSubstr("<th>measured (UTC)</th><td>2024-05-02T08:10:00Z to "
                              "2024-05-02T08:30:00Z</td>"),
                    HasSubstr("<th>identified (UTC)</th><td>2024-05-17T08:30:00.")));
  EXPECT_THAT(comparison_report(subject, reported(4)).value(),
              AllOf(HasSubstr("<td>measured 2024-05-02T08:10:00Z to 2024-05-02T08:30:00Z</td>"),
                    HasSubstr("<td>identified 2024-05-17T08:30:00Z; when it was measured is not "
                              "recorded</td>")));
}

TEST(ModelReport, NamesEquipmentWhoseCalibrationHadExpired) {
  ReportSubject subject = reported(3);
  subject.details.equipment = {{"laser tracker", "", "", "", "", "2024-05-16"},
                               {"probe", "", "", "", "", "2024-05-17"},
                               {"thermometer", "", "", "", "", ""}};
  EXPECT_THAT(
      model_report(subject).value(),
      AllOf(HasSubstr("<li>equipment &quot;laser tracker&quot;: its calibration was valid "
                      "until 2024-05-16, the model was identified 2024-05-17</li>"),
            Not(HasSubstr("equipment &quot;probe")), Not(HasSubstr("equipment &quot;thermo"))));
  const auto last = subject.document.created - std::chrono::hours(48);
  subject.document.run = measured_at(last - std::chrono::minutes(20), last);
  EXPECT_THAT(model_report(subject).value(), Not(HasSubstr("its calibration was valid until")));
}

TEST(TrendReport, OrdersModelsByTheirMeasurementNotByTheirIdentification) {
  ReportSubject earlier = reported(3), later = reported(4);
  earlier.document.run = measured_at(later.document.created - std::chrono::hours(48),
                                     later.document.created - std::chrono::hours(47));
  earlier.document.created += std::chrono::hours(24);
  const std::string page = trend_report({later, earlier}).value();
  EXPECT_LT(page.find(model_id(earlier.document)), page.find(model_id(later.document)));
  EXPECT_THAT(page, HasSubstr("<td>2024-05-15T09:30</td>"));
}

TEST(LinePlot, HasASecondPanelWhereTheBandsAreNarrow) {
  LineChart chart{.title = "t", .x_label = "x", .y_label = "y"};
  chart.curves = {{.name = "a", .x = {0, 1, 2}, .y = {0, 50, 100}, .u = {0.1, 0.2, 0.1}}};
  const std::string narrow = svg(chart);
  EXPECT_THAT(narrow, HasSubstr("U = 2 u of these curves"));
  chart.curves[0].u = {5, 6, 5};
  EXPECT_THAT(svg(chart), Not(HasSubstr("U = 2 u of these curves")));
  EXPECT_EQ(times(narrow, "class=\"band\""), 1u);
}

TEST(LinePlot, DrawsOnlyFinitePoints) {
  LineChart chart{.title = "<t>", .x_label = "x", .y_label = "y"};
  const double nan = std::nan("");
  chart.curves = {{.name = "a", .x = {0, 1, 2, 3, 4}, .y = {1, 2, nan, 2, 1}}};
  const std::string text = svg(chart);
  EXPECT_THAT(text, AllOf(Not(HasSubstr("nan")), Not(HasSubstr("inf")), HasSubstr("&lt;t&gt;")));
  const auto path = text.substr(text.rfind("<path d=\"M"));
  EXPECT_EQ(times(path.substr(0, path.find("/>")), "M"), 2u) << "two pieces";
  EXPECT_THAT(svg(LineChart{.title = "empty", .x_label = "x", .y_label = "y"}),
              Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace abbe::daemon
