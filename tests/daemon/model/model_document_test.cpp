#include "abbe/model/model_document.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <array>
#include <bit>
#include <cstdint>
#include <set>

#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using test::synthetic_document;
using test::synthetic_model;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

TEST(ModelDocument, KeepsWhatTheRunLeftOutsideItsHash) {
  auto document = synthetic_document(1);
  document.verdict.reset();  // it has notes, too
  const auto hash = model_hash(document);
  document.run = RunFigures{.held_out = "legs",
                            .held_out_before_m = 1e-5 / 3,
                            .held_out_after_m = 1e-7 / 3,
                            .notes = {"a \"note\"", "another"},
                            .residuals = {{0.1 / 3, 1e-5 / 3, 1e-7 / 7}, {0.2, 2e-5, 3e-7}},
                            .places_m = {{{0.1 / 3, 0.2, -0.3}, {0.0, 0.1 / 7, 0.0}}, {}}};
  const auto text = to_json(document);
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().text << text;
  EXPECT_EQ(read->run, document.run);
  EXPECT_EQ(model_hash(*read), hash);
  EXPECT_EQ(to_json(*read), text);
  EXPECT_FALSE(parse_model(to_json(synthetic_document(1)), "model.json")->run);

  for (const auto& [what, with] :
       {std::pair{"\"notes\": [", "\"notes\": [1,"},
        std::pair{"\"held_out\": \"legs\"", "\"held_out\": 3"},
        std::pair{"before_um_after_um\": [", "before_um_after_um\": [[1],"},
        std::pair{"places_mm\": [", "places_mm\": [1,"},
        std::pair{"\"notes\": [", "\"notes\": {}, \"more\": ["}}) {
    const auto refused = parse_model(replaced(text, what, with), "model.json");
    ASSERT_FALSE(refused) << with;
    EXPECT_THAT(refused.error().details.front(), HasSubstr("run.")) << with;
  }
}

RunFigures figures_of_every_kind() {
  return {
      .held_out = "legs",
      .residuals = {},
      .part_kind = "leg",
      .parts = {{"leg \"1\"", 12, 1e-5 / 3, 1e-7 / 3, 1e-6 / 7, std::array{0.1 / 3, 4.5}},
                {"leg 2", 1, 1e-5, 1e-7, 1e-7, std::nullopt}},
      .series = ResidualSeries{3, true, {{0.1 / 3, 1e-7 / 3}, {0.2, -1e-7 / 7}}},
      .sigma_counts = std::vector<std::size_t>(RunFigures::kSigmaIntervals, 5),
      .held_out_cells = {{0, 7, 3, 1e-5 / 3, 1e-7 / 3, 1e-6 / 3}},
      .tables = {{"Title <1>", "why", {"a", "b"}, {{"1", "2"}, {"3", "\u00b5"}}},
                 {"facts", "", {}, {{"name", "value"}}},
                 {"empty", "", {"a"}, {}}},
      .conditions =
          RunConditions{
              std::array{293.15, 880.0 / 3}, std::array{291.0, 877.0 / 3}, 100.0 / 3, 0.125 / 3,
              std::array{protocol::UtcTime{std::chrono::nanoseconds{1'715'934'600'123'456'789}},
                         protocol::UtcTime{std::chrono::nanoseconds{1'715'934'700'000'000'001}}}},
      .of_model = "00c0ffee"};
}

TEST(ModelDocument, KeepsResidualsTablesAndConditionsOfTheRun) {
  auto document = synthetic_document(1);
  const auto hash = model_hash(document);
  document.run = figures_of_every_kind();
  const auto text = to_json(document);
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().text << read.error().details.front();
  EXPECT_EQ(read->run, document.run);
  EXPECT_EQ(to_json(*read), text);
  EXPECT_EQ(model_hash(*read), hash);
  document.run->conditions = RunConditions{};
  EXPECT_EQ(parse_model(to_json(document), "model.json")->run, document.run);
}

TEST(ModelDocument, RefusesDamagedFiguresOfTheRunByName) {
  auto document = synthetic_document(1);
  document.run = figures_of_every_kind();
  const auto text = to_json(document);
  for (const auto& [what, with] :
       {std::pair{"\"parts\": [", "\"parts\": [1,"},
        std::pair{"\"parts\": [", "\"parts\": 1, \"x\": ["},
        std::pair{"\"count\": 12", "\"count\": -1"}, std::pair{"\"time_s\"", "\"weeks\""},
        std::pair{"at_after_um\": [", "at_after_um\": [[1],"},
        std::pair{"sigma_counts\": [5, ", "sigma_counts\": ["},
        std::pair{"held_out_cells\": [", "held_out_cells\": [[1, 2],"},
        std::pair{"\"tables\": [", "\"tables\": [1,"},
        std::pair{"\"columns\": [", "\"columns\": [1, "}, std::pair{"\"rows\": [", "\"rows\": [1,"},
        std::pair{"\"temperature_K\": [", "\"temperature_K\": [1, "},
        std::pair{"bar_temperature_K\": [", "bar_temperature_K\": [1, "},
        std::pair{"\"duration_s\": ", "\"duration_s\": \"long\", \"x\": "},
        std::pair{"measured_utc\": [", "measured_utc\": [1, "},
        std::pair{"measured_utc\": [\"2024", "measured_utc\": [\"2025"},
        std::pair{"\"conditions\": ", "\"conditions\": 1, \"x\": "}}) {
    const auto refused = parse_model(replaced(text, what, with), "model.json");
    ASSERT_FALSE(refused) << with;
    EXPECT_THAT(refused.error().details.front(), HasSubstr("run.")) << with;
  }
}

TEST(ModelDocument, KeepsTheVersionThatIdentifiedTheModel) {
  const auto document = synthetic_document(1);
  auto text = to_json(document);
  const auto begin = text.find("\"abbe_version\": \"") + 17;
  text.replace(begin, text.find('"', begin) - begin, "0.0.7-earlier");
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(read->software, "0.0.7-earlier");
  EXPECT_EQ(to_json(*read), text);
}

TEST(ModelDocument, ReadsBackToTheSameBits) {
  const auto written = synthetic_document(1);
  const auto read = parse_model(to_json(written), "model.json");
  ASSERT_TRUE(read) << read.error().text << read.error().details.front();
  ASSERT_EQ(read->model.U().size(), written.model.U().size());
  for (Eigen::Index i = 0; i < written.model.U().size(); ++i)
    EXPECT_TRUE(same_bits(read->model.U()[i], written.model.U()[i])) << i;
  const auto& a = written.model.covariance();
  const auto& b = read->model.covariance();
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index j = 0; j < a.cols(); ++j)
      EXPECT_TRUE(same_bits(a(i, j), b(i, j))) << i << "," << j;
}

TEST(ModelDocument, ReadsBackWithItsOrigin) {
  const auto written = synthetic_document(2);
  const auto read = parse_model(to_json(written), "model.json");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->machine, written.machine);
  EXPECT_EQ(read->created, written.created);
  EXPECT_EQ(read->inputs, written.inputs);
  EXPECT_EQ(read->statistics, written.statistics);
}

TEST(ModelDocument, ReadsTheEarlierNameOfTheVarianceFactor) {
  const auto document = synthetic_document(2);
  auto text = to_json(document);
  const std::string name = "\"variance_factor\"";
  ASSERT_NE(text.find(name), std::string::npos);
  text.replace(text.find(name), name.size(), "\"covariance_factor\"");
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(read->statistics, document.statistics);
}

TEST(ModelDocument, ReadsTheEarlierNamesOfTheDatum) {
  const auto document = synthetic_document(2);
  auto text = to_json(document);
  const std::string name = "\"datum\"";
  ASSERT_NE(text.find(name), std::string::npos);
  text.replace(text.find(name), name.size(), "\"gauge\"");
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(read->model.datum(), document.model.datum());
  EXPECT_EQ(model_hash(*read), model_hash(document));
}

TEST(ModelDocument, WritesTheSameBytesAgain) {
  const auto text = to_json(synthetic_document(3));
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read);
  EXPECT_EQ(to_json(*read), text);
}

TEST(ModelDocument, HashLeavesOutDatesAndInputs) {
  auto document = synthetic_document(4);
  const auto hash = model_hash(document);
  document.created += std::chrono::hours{1};
  document.inputs.clear();
  const auto read = parse_model(to_json(document), "model.json");
  ASSERT_TRUE(read);
  EXPECT_EQ(model_hash(*read), hash);
  EXPECT_THAT(hash, SizeIs(64));
}

TEST(ModelDocument, HashFollowsOneBitOfOneParameter) {
  const auto model = synthetic_model(5);
  auto description = model.description();
  description.parameters[7].value = std::nextafter(description.parameters[7].value, 1.0);
  const auto other = calib::VolumetricModel::from_description(description);
  ASSERT_TRUE(other);
  EXPECT_NE(model_hash({model}), model_hash({*other}));
}

/// Of a glass array 3 K above 20 C.
ModelDocument with_artefact(std::uint32_t seed) {
  auto document = synthetic_document(seed);
  document.artefact = calib::Expansion{
      .alpha_per_K = 8e-6, .u_alpha_per_K = 1e-6, .temperature_K = 296.15, .u_temperature_K = 0.2};
  return document;
}

TEST(ModelDocument, HashFollowsEveryNumberOfTheArtefact) {
  const auto document = with_artefact(11);
  std::set<std::string> hashes{model_hash(document), model_hash(synthetic_document(11))};
  for (double calib::Expansion::*number :
       {&calib::Expansion::alpha_per_K, &calib::Expansion::u_alpha_per_K,
        &calib::Expansion::temperature_K, &calib::Expansion::u_temperature_K}) {
    auto other = document;
    other.artefact.value().*number *= 1.001;
    hashes.insert(model_hash(other));
  }
  EXPECT_THAT(hashes, SizeIs(6));
}

TEST(ModelDocument, ReadsBackWithItsArtefact) {
  const auto written = with_artefact(12);
  const auto read = parse_model(to_json(written), "model.json");
  ASSERT_TRUE(read) << read.error().details.front();
  ASSERT_TRUE(read->artefact);
  EXPECT_EQ(read->artefact->temperature_K, 296.15);
  EXPECT_EQ(read->artefact->u_alpha_per_K, 1e-6);
  EXPECT_EQ(model_id(*read), model_id(written));
}

TEST(ModelDocument, IsRefusedWhenItsArtefactWasChanged) {
  const auto text = replaced(to_json(with_artefact(13)), "\"temperature_K\": 296.15",
                             "\"temperature_K\": 297.15");
  const auto read = parse_model(text, "model.json");
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().details, ElementsAre(HasSubstr("hash: is not the hash of the content")));
  auto without = to_json(with_artefact(13));
  const auto from = without.find("  \"artefact\""), to = without.find("  \"inputs\"");
  EXPECT_FALSE(parse_model(without.erase(from, to - from), "model.json"));
}

TEST(ModelDocument, NamesInconsistentValuesOfItsArtefact) {
  const auto fault = [](const std::string& what, const std::string& with) {
    const auto read = parse_model(replaced(to_json(with_artefact(14)), what, with), "model.json");
    return read ? std::string{} : read.error().details.front();
  };

  EXPECT_THAT(fault("\"temperature_K\": 296.15", "\"temperature_K\": -3"),
              HasSubstr("model.json: artefact.temperature_K: is not plausible: -3"));
  EXPECT_THAT(fault("\"u_temperature_K\": 0.2", "\"u_temperature_K\": -0.2"),
              HasSubstr("artefact.u_temperature_K: is not plausible"));
  EXPECT_THAT(fault("\"alpha_um_per_m_K\": 8", "\"alpha_um_per_m_K\": 8000"),
              HasSubstr("artefact.alpha_um_per_m_K: is not plausible"));
  EXPECT_THAT(fault("\"u_alpha_um_per_m_K\": 1", "\"u_alpha_um_per_m_K\": -1"),
              HasSubstr("artefact.u_alpha_um_per_m_K: is not plausible"));
  EXPECT_THAT(fault("\"temperature_K\": 296.15", "\"temperature_K\": 1e999"),
              HasSubstr("artefact.temperature_K: out of range"));
  EXPECT_THAT(fault("\"temperature_K\": 296.15", "\"temperature_K\": \"warm\""),
              HasSubstr("artefact.temperature_K: must be a number"));
  EXPECT_THAT(fault("\"u_alpha_um_per_m_K\": 1,", ""),
              HasSubstr("artefact.u_alpha_um_per_m_K: missing"));
}

TEST(ModelDocument, WritesLengthsInMmAndErrorsInMicrometres) {
  const auto text = to_json(synthetic_document(6));
  EXPECT_THAT(text, HasSubstr("\"tool_offsets_mm\": [[20, -15, -120]]"));
  EXPECT_THAT(text, HasSubstr("\"nodes_mm\": [-300, -150, 0, "));
  EXPECT_THAT(text, HasSubstr("\"unit\": \"urad\""));
}

TEST(ModelDocument, IsRefusedWhenANumberWasChanged) {
  const auto text = to_json(synthetic_document(7));
  const auto at = text.find("\"value\": ") + 9;
  auto changed = text;
  changed[at + 3] = changed[at + 3] == '1' ? '2' : '1';
  const auto read = parse_model(changed, "model.json");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::BadInput);
  EXPECT_THAT(read.error().details, ElementsAre(HasSubstr("hash: is not the hash of the content")));
}

/// Its own hash is right: no single variance is negative, that of a difference of two parameters
/// is.
TEST(ModelDocument, IsRefusedWithACovarianceThatIsNotPositive) {
  const auto document = synthetic_document(11);
  Eigen::MatrixXd covariance = document.model.covariance();
  Eigen::Index i = 0;
  while (!(covariance(i, i) > 0.0 && covariance(i + 1, i + 1) > 0.0)) ++i;
  covariance(i, i + 1) = covariance(i + 1, i) =
      2.0 * std::sqrt(covariance(i, i) * covariance(i + 1, i + 1));
  auto changed = document;
  changed.model =
      calib::VolumetricModel::from_vector(document.model.tables()->layout(), document.model.datum(),
                                          document.model.tool_offsets_m(), document.model.U(),
                                          covariance, document.model.validity())
          .value();
  const auto read = parse_model(to_json(changed), "model.json");

  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().details, ElementsAre(AllOf(HasSubstr("model.json: covariance: "),
                                                      HasSubstr("positive semidefinite"))));
}

TEST(ModelDocument, KeepsTheMisfit) {
  auto document = synthetic_document(3);
  const auto without = model_hash(document);
  const auto n = document.model.U().size();
  document.model =
      document.model
          .with_misfit({.u_of_parameters = Eigen::VectorXd::LinSpaced(n, 0.0, 1e-6 / 3),
                        .u_V_m = {1e-6 / 7, 0.0, 2e-6},
                        .table_length_m = 0.01 / 3,
                        .V_length_m = 0.1})
          .value();
  const auto text = to_json(document);
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_NE(read->model.misfit(), nullptr);
  EXPECT_EQ(read->model.misfit()->u_of_parameters, document.model.misfit()->u_of_parameters);
  EXPECT_EQ(read->model.misfit()->u_V_m, document.model.misfit()->u_V_m);
  EXPECT_EQ(to_json(*read), text);
  EXPECT_NE(model_hash(document), without);

  const auto refused =
      parse_model(replaced(text, "\"u_V_um\": [", "\"u_V_um\": [1,"), "model.json");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              ElementsAre(HasSubstr("misfit.u_V_um: 4 values, expected 3")));
}

TEST(ModelDocument, KeepsThePlaceOfTheTracker) {
  auto document = synthetic_document(3);
  const auto without = model_hash(document);
  const auto n = document.model.U().size();
  document.tracker_place = {"hall 3, \"door\"",
                            {.dU_dd = Eigen::VectorXd::LinSpaced(n, -1.0 / 3, 2.0),
                             .value_m = -3e-6 / 7,
                             .u_m = 1e-6 / 3,
                             .u_prior_m = 6e-6}};
  const auto text = to_json(document);
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_TRUE(read->tracker_place);
  EXPECT_EQ(read->tracker_place->name, "hall 3, \"door\"");
  EXPECT_EQ(read->tracker_place->range_offset.dU_dd, document.tracker_place->range_offset.dU_dd);
  EXPECT_EQ(to_json(*read), text);
  EXPECT_NE(model_hash(document), without);

  const auto refused =
      parse_model(replaced(text, "\"derivatives\": [", "\"derivatives\": [1,"), "model.json");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              ElementsAre(HasSubstr(fmt::format("tracker_place.derivatives: {} values for {} "
                                                "parameters",
                                                n + 1, n))));
}

TEST(ModelDocument, ReportsEveryFaultAtOnce) {
  auto text = to_json(synthetic_document(8));
  text = replaced(text, "\"datum\": \"G1\"", "\"datum\": \"G7\"");
  text = replaced(text, "\"squareness\": \"travel\"", "\"squareness\": 1");
  text = replaced(text, "\"sigma0\"", "\"sigma1\"");
  const auto read = parse_model(text, "model.json");
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().details,
              ::testing::IsSupersetOf({HasSubstr("model.json: datum: must be \"G1\""),
                                       HasSubstr("squareness: must be a string"),
                                       HasSubstr("statistics.sigma0: missing")}));
}

TEST(ModelDocument, IsRefusedBeforeItIsParsedWhenItNestsTooDeep) {
  for (const std::string& text : {std::string(100'000, '['), "{\"a\":" + std::string(17, '[')}) {
    const auto read = parse_model(text, "model.json");
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().code, ErrorCode::BadInput);
    EXPECT_THAT(read.error().text, HasSubstr("model.json: nested deeper than 16"));
  }
}

TEST(ModelDocument, IsRefusedWhenCutAnywhere) {
  const auto text = to_json(synthetic_document(9));
  for (std::size_t length = 0; length + 2 < text.size(); length += 997) {
    const auto read = parse_model(std::string_view{text}.substr(0, length), "model.json");
    ASSERT_FALSE(read) << length;
    EXPECT_EQ(read.error().code, ErrorCode::BadInput);
  }
}

/// One value per table, and one per node.
ModelDocument document_with_backlash() {
  auto document = synthetic_document(11);
  document.backlash = {
      {.motion = {calib::Motion::X, calib::Axis::X}, .value = 2.859e-6, .u = 8.6e-8},
      {.motion = {calib::Motion::B, calib::Axis::X},
       .position_m = -0.3,
       .value = -3.6e-6,
       .u = 2.4e-7}};
  return document;
}

TEST(ModelDocument, ReadsBackWithBacklash) {
  const auto written = document_with_backlash();
  const auto read = parse_model(to_json(written), "model.json");
  ASSERT_TRUE(read) << read.error().text << read.error().details.front();
  ASSERT_THAT(read->backlash, SizeIs(2));
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read->backlash[i].motion, written.backlash[i].motion);
    EXPECT_EQ(read->backlash[i].position_m, written.backlash[i].position_m);
    EXPECT_TRUE(same_bits(read->backlash[i].value, written.backlash[i].value));
    EXPECT_TRUE(same_bits(read->backlash[i].u, written.backlash[i].u));
    EXPECT_TRUE(read->backlash[i].determined);
  }
  EXPECT_EQ(to_json(*read), to_json(written));
}

TEST(ModelDocument, IsNamedWhereBacklashIsUnreadable) {
  const auto text = to_json(document_with_backlash());
  for (const auto& [what, with, where] :
       {std::array{"\"name\": \"EBX\", \"position_mm\": -300, \"value\": -3.6",
                   "\"name\": \"EBQ\", \"position_mm\": -300, \"value\": -3.6",
                   "backlash[1].name: must be an error such as EXX"},
        std::array{"\"value\": 2.859,", "\"value\": \"2\",", "backlash[0].value: must be a number"},
        std::array{"\"backlash\": [", "\"backlash\": 3, \"other\": [",
                   "backlash: must be an array"}}) {
    const auto read = parse_model(replaced(text, what, with), "model.json");
    ASSERT_FALSE(read) << what;
    EXPECT_THAT(read.error().details, ::testing::Contains(HasSubstr(where)));
  }
}

ModelDocument document_of_a_bar() {
  auto document = synthetic_document(4);
  document.method = "mfb";
  document.bar = BarFigures{
      .passes = {{"X1", 1.02}, {"X1 \"back\"", 0.97}},
      .drift = {{"X1", "X1 \"back\"", {1e-6, -2e-7, 0.0}, {1e-7, 1e-7, 2e-7}}},
      .set_aside = {{"X1", "plane", "L", 3, 0, 48.5e-6}, {"X1", "hole", "", 5, 7, -31e-6}}};
  return document;
}

TEST(ModelDocument, ReadsBackWithTheFiguresOfABar) {
  const auto written = document_of_a_bar();
  const auto read = parse_model(to_json(written), "model.json");
  ASSERT_TRUE(read) << read.error().details.front();
  EXPECT_EQ(read->bar, written.bar);
  EXPECT_EQ(to_json(*read), to_json(written));
  auto without = written;
  without.bar.reset();
  EXPECT_EQ(model_hash(written), model_hash(without));
  EXPECT_FALSE(parse_model(to_json(without), "model.json")->bar);
}

TEST(ModelDocument, IsNamedWhereTheFiguresOfABarAreUnreadable) {
  const auto text = to_json(document_of_a_bar());
  const auto fault = [&](const std::string& what, const std::string& with) {
    const auto read = parse_model(replaced(text, what, with), "model.json");
    return read ? std::string{} : read.error().details.front();
  };
  EXPECT_THAT(fault("\"k\": 7", "\"k\": -7"),
              HasSubstr("statistics.set_aside.k: must be a whole number"));
  EXPECT_THAT(fault("\"feature\": \"hole\"", "\"feature\": 1"),
              HasSubstr("statistics.set_aside.feature: must be a string"));
  EXPECT_THAT(fault("[1, -0.2, 0]", "[1, -0.2]"),
              HasSubstr("statistics.drift_um_per_pass.value: must be [x, y, z]"));
}

TEST(ModelDocument, GivesBacklashToSpreadsheets) {
  const auto document = document_with_backlash();
  const auto csv = to_tables_csv(document.model, document.backlash);
  EXPECT_THAT(csv, HasSubstr("\nEXX.backlash,,2.859,0.086,um\nEBX.backlash,-300,-3.6,0.24,urad\n"));
}

TEST(ModelDocument, GivesTablesOfSixDigitsToPeople) {
  const auto csv = to_tables_csv(synthetic_model(10), {}, Digits::Six);
  EXPECT_THAT(csv, ::testing::StartsWith("name,position_mm,value,u,unit\nEXX,-300,"));
  EXPECT_THAT(csv, Not(::testing::ContainsRegex("[1-9][0-9]{6}")));
  EXPECT_THAT(csv, Not(::testing::ContainsRegex("[1-9][.][0-9]{6}")));
}

TEST(ModelDocument, GivesTablesToSpreadsheets) {
  const auto csv = to_tables_csv(synthetic_model(10));
  EXPECT_THAT(csv, ::testing::StartsWith("name,position_mm,value,u,unit\nEXX,-300,"));
  EXPECT_THAT(csv, HasSubstr("\nEC0Y,,"));
  EXPECT_THAT(csv, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace abbe::daemon
