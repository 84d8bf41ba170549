// Each format: what is written, read as the control reads it, is what the format can hold.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "abbe/exports/prove_export.hpp"
#include "abbe/exports/write_export.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using ::testing::HasSubstr;

/// An export of a model with backlash, without a disk.
struct MadeExport {
  const FormatFacts* facts = nullptr;
  HeldCorrection held;
  WriteOptions options;
  ControlSettings settings;
  std::vector<ExportFile> files;
  std::vector<calib::ExportPlace> places;
};

calib::Vector3 held_at(const HeldCorrection& held, const calib::ExportPlace& place) {
  if (const auto* grid = std::get_if<calib::HeldGrid>(&held); grid != nullptr)
    return grid->c_m(place.commanded_m);
  return std::get<calib::HeldTables>(held).c_m(place.commanded_m, place.travel);
}

HeldCorrection held_by_format(const FormatFacts& facts, const calib::VolumetricModel& model,
                              const calib::Vector3& tool_m, const calib::GridAxes& nodes) {
  if (facts.holds == HeldPart::Grid) return calib::grid_of_model(model, tool_m, nodes, {}).value();
  if (facts.holds == HeldPart::Errors) return calib::tables_of_model(model, tool_m, nodes).value();
  const auto motions = facts.holds == HeldPart::Positioning ? calib::positioning_motions()
                                                            : calib::translation_motions();
  return calib::fit_tables(model, tool_m, motions, nodes, facts.per_direction).value();
}

MadeExport made_export(const std::string& format, const calib::VolumetricModel& model) {
  MadeExport made;
  made.facts = format_named(format);
  const auto& facts = *made.facts;
  const calib::Vector3 tool_m = model.tool_offsets_m().front();
  const auto box = calib::export_box(model).value();
  calib::NodeOptions nodes;
  nodes.equidistant = facts.equidistant;
  made.held = held_by_format(facts, model, tool_m, calib::export_nodes(model, box, nodes).value());

  made.options.positive_moves = facts.positive_moves == 0 ? -1 : facts.positive_moves;
  made.settings.positive_moves = made.options.positive_moves;
  for (std::size_t a = 0; a < 3; ++a) {
    made.options.axis_names[a] = made.settings.axis_names[a] = facts.axis_names[a];
    made.settings.tool_m[a] = tool_m[static_cast<Eigen::Index>(a)];
  }
  made.files = write_export(facts.format, made.held, made.options).value();
  made.places = calib::random_places(model, box, kExportPlaces, 7).value();
  return made;
}

Result<ExportProof> proof_of(const MadeExport& made, std::span<const ExportFile> files) {
  return prove_export(made.facts->format, files, made.settings, made.places,
                      [&](const calib::ExportPlace& place) { return held_at(made.held, place); });
}

/// Changes the sign of every word of a line that is a value of the format.
std::string with_opposite_values(const std::string& format, const std::string& line) {
  const bool assignment = format.starts_with("siemens");
  const auto flipped = [](const std::string& number) {
    return number.front() == '-' ? number.substr(1) : "-" + number;
  };
  if (assignment) {
    const auto at = line.find("]=");
    const bool value = line.starts_with("$AN_CEC[") || line.starts_with("$AA_ENC_COMP[");
    return value ? line.substr(0, at + 2) + flipped(line.substr(at + 2)) : line;
  }

  const char separator = format == "csv-grid" ? ',' : ' ';
  const std::size_t first = format == "csv-grid" ? 3 : format == "heidenhain-com" ? 2 : 1;
  const std::size_t last = format == "csv-grid" ? 5 : 100;
  std::istringstream words(line);
  std::string out, word;
  for (std::size_t i = 0; std::getline(words, word, separator); ++i) {
    const bool number = word.find_first_not_of("-+.0123456789e") == std::string::npos;
    if (i > 0) out += separator;
    out += i >= first && i <= last && number ? flipped(word) : word;
  }
  return out;
}

std::vector<ExportFile> with_opposite_sign(const MadeExport& made) {
  std::vector<ExportFile> files;
  const std::string format(made.facts->name);
  for (const auto& file : made.files) {
    std::istringstream lines(file.text);
    ExportFile flipped{file.name, ""};
    for (std::string line; std::getline(lines, line);) {
      const bool comment = line.empty() || line.starts_with('/') || line.starts_with('#') ||
                           line.starts_with('[') || line.starts_with('}');
      const bool values = !comment && file.name != "config.cma";
      flipped.text += (values ? with_opposite_values(format, line) : line) + "\n";
    }
    files.push_back(flipped);
  }
  return files;
}

class EveryFormat : public ::testing::TestWithParam<const char*> {};

TEST_P(EveryFormat, GivesAtRandomPlacesWhatItHolds) {
  const auto made = made_export(GetParam(), test::synthetic_travel_model(3));
  const auto proof = proof_of(made, made.files);
  ASSERT_TRUE(proof) << proof.error().text;
  EXPECT_EQ(proof->places, kExportPlaces);
  EXPECT_LE(proof->largest_difference_m, kExportTolerance_m);
}

TEST_P(EveryFormat, OfCubicTables) {
  auto description = test::synthetic_model(5).description();
  description.interpolation = calib::Interpolation::NaturalCubic;
  const auto model = calib::VolumetricModel::from_description(std::move(description)).value();
  const auto made = made_export(GetParam(), model);
  const auto proof = proof_of(made, made.files);
  EXPECT_TRUE(proof) << proof.error().text;
}

TEST_P(EveryFormat, IsRefusedWithTheOppositeSign) {
  const auto made = made_export(GetParam(), test::synthetic_model(3));
  const auto proof = proof_of(made, with_opposite_sign(made));
  ASSERT_FALSE(proof);
  EXPECT_EQ(proof.error().code, ErrorCode::Refused);
  EXPECT_THAT(proof.error().text, HasSubstr("the sign is opposite"));
}

TEST_P(EveryFormat, MakesTheMachineBetter) {
  const auto model = test::synthetic_model(3);
  const auto made = made_export(GetParam(), model);
  const auto control = read_as_control(made.facts->format, made.files, made.settings).value();
  const auto loss = calib::export_loss(
      model, model.tool_offsets_m().front(), made.places, {}, [&](const calib::ExportPlace& place) {
        const auto& p = place.commanded_m;
        const AxisPosition c = control({p[0], p[1], p[2]}, {1, 1, 1});
        return calib::Vector3(c[0], c[1], c[2]);
      });
  ASSERT_TRUE(loss);
  EXPECT_LT(loss->rms_lost_m.norm(), loss->rms_without_m.norm());
}

TEST_P(EveryFormat, ReadsNoCutFile) {
  const auto made = made_export(GetParam(), test::synthetic_model(3));
  auto files = made.files;
  files.front().text.resize(files.front().text.size() / 2);
  EXPECT_FALSE(proof_of(made, files));
}

TEST_P(EveryFormat, KeepsHostileNamesInOneComment) {
  auto made = made_export(GetParam(), test::synthetic_model(3));
  made.options.origin.machine = "mill\nM30\r\n$AN_CEC[0,0]=9 \x1b[2J";
  made.options.origin.volume = "]\n#\n";
  const auto files = write_export(made.facts->format, made.held, made.options).value();
  const auto proof = proof_of(made, files);
  EXPECT_TRUE(proof) << proof.error().text;
}

/// Files without comments have it in export.txt beside them.
TEST_P(EveryFormat, StatesItsOriginAndValidityWhereItHasComments) {
  auto made = made_export(GetParam(), test::synthetic_model(3));
  made.options.origin = {.model_hash = "00c0ffee",
                         .machine = "mill",
                         .volume = "X -300 to 300 mm",
                         .tool = "20, -15, -120 mm",
                         .direction = ""};
  std::string text;
  const auto files = write_export(made.facts->format, made.held, made.options).value();
  for (const auto& file : files) text += file.text;
  for (const char* const stated :
       {"abbe export of model 00c0ffee", "machine: mill",
        "valid for X -300 to 300 mm, tool offset 20, -15, -120 mm", "sign: "}) {
    EXPECT_EQ(text.find(stated) != std::string::npos, made.facts->comments) << stated;
  }
  const bool none =
      std::string(GetParam()) == "linuxcnc-comp" || std::string(GetParam()) == "heidenhain-com";
  EXPECT_EQ(made.facts->comments, !none);
}

INSTANTIATE_TEST_SUITE_P(Exports, EveryFormat,
                         ::testing::Values("isg-csv", "etalon", "linuxcnc-comp", "siemens-cec",
                                           "siemens-lec", "heidenhain-com", "csv-grid"));

TEST(ExportProof, LinuxcncEndsAtACommentWithoutAMessage) {
  auto made = made_export("linuxcnc-comp", test::synthetic_model(3));
  made.files[1].text = "# Y axis\n" + made.files[1].text;
  const auto proof = proof_of(made, made.files);
  ASSERT_FALSE(proof);
  EXPECT_THAT(proof.error().text, HasSubstr("y.comp:1: not three numbers"));
}

TEST(ExportProof, LinuxcncTakesNo257Rows) {
  const auto model = test::synthetic_model(3);
  const auto box = calib::export_box(model).value();
  calib::NodeOptions options;
  options.step_m = 0.001;
  const auto nodes = calib::export_nodes(model, box, options).value();
  const auto held = calib::fit_tables(model, model.tool_offsets_m().front(),
                                      calib::positioning_motions(), nodes, false);
  const auto files = write_export(ExportFormat::LinuxcncComp, held.value(), {});
  ASSERT_FALSE(files);
  EXPECT_THAT(files.error().text, HasSubstr("601 nodes on axis X; the control takes at most 256"));
}

TEST(ExportProof, SinumerikNeedsAllPoints) {
  auto made = made_export("siemens-lec", test::synthetic_model(3));
  auto& text = made.files.front().text;
  const auto at = text.find("$AA_ENC_COMP[0,1,Y1]=");
  ASSERT_NE(at, std::string::npos);
  text.erase(at, text.find('\n', at) + 1 - at);
  const auto proof = proof_of(made, made.files);
  ASSERT_FALSE(proof);
  EXPECT_THAT(proof.error().text, HasSubstr("4 points, but (MAX - MIN) / STEP is 4"));
}

TEST(ExportProof, NamesTheAxesOfTheControl) {
  auto made = made_export("siemens-cec", test::synthetic_model(3));
  made.settings.axis_names = {"AX1", "AX2", "AX7"};
  EXPECT_FALSE(proof_of(made, made.files));
}

}  // namespace
}  // namespace abbe::daemon
