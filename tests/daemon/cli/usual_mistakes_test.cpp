/// Files of measurements with one usual mistake each, for every command that reads them: the right
/// mistake is named first. Sound files get no hint. Machines and noise have fixed seeds.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "abbe_command.hpp"
#include "bar_files.hpp"
#include "config_tables.hpp"
#include "encoder_run.hpp"
#include "evemu_run.hpp"
#include "made_run_files.hpp"
#include "repetitions.hpp"
#include "synthetic_model.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using calib::Vector3;
using Cells = std::vector<std::string>;
using Row = std::map<std::string, std::string>;

/// A CSV file whose cells can be changed.
struct Csv {
  Cells names;
  std::vector<Cells> rows;

  static Cells split(const std::string& line) {
    Cells cells;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
    return cells;
  }
  static Csv of(const std::string& text) {
    Csv csv;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) {
      if (csv.names.empty())
        csv.names = split(line);
      else
        csv.rows.push_back(split(line));
    }
    return csv;
  }
  [[nodiscard]] std::size_t column(const std::string& name) const {
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i] == name) return i;
    ADD_FAILURE() << "no column " << name;
    return 0;
  }
  [[nodiscard]] std::string text() const {
    std::string out = fmt::format("{}\n", fmt::join(names, ","));
    for (const Cells& row : rows) out += fmt::format("{}\n", fmt::join(row, ","));
    return out;
  }
};

using Change = std::function<void(Csv&)>;

Change each(const std::string& name, const std::function<double(double)>& value) {
  return [=](Csv& csv) {
    const auto c = csv.column(name);
    for (Cells& row : csv.rows) row[c] = fmt::format("{:.17g}", value(std::stod(row[c])));
  };
}
Change scaled(const Cells& columns, double factor) {
  return [=](Csv& csv) {
    for (const auto& name : columns) each(name, [=](double v) { return factor * v; })(csv);
  };
}
Change reversed(const std::string& name) {
  return scaled({name}, -1.0);
}
Change swapped(const std::string& a, const std::string& b) {
  return [=](Csv& csv) {
    const auto i = csv.column(a), j = csv.column(b);
    for (Cells& row : csv.rows) std::swap(row[i], row[j]);
  };
}
Change both(const Change& a, const Change& b) {
  return [=](Csv& csv) {
    a(csv);
    b(csv);
  };
}
/// The columns of row i are those of row n - 1 - i.
Change backwards(const Cells& columns) {
  return [=](Csv& csv) {
    const auto given = csv.rows;
    for (const auto& name : columns)
      for (std::size_t i = 0; i < given.size(); ++i)
        csv.rows[i][csv.column(name)] = given[given.size() - 1 - i][csv.column(name)];
  };
}
void with_a_row_twice(Csv& csv) {
  csv.rows.push_back(csv.rows.front());
}

const Cells kXyz{"x_mm", "y_mm", "z_mm"};
const Cells kTracker{"tracker_x_mm", "tracker_y_mm", "tracker_z_mm"};
constexpr double kInch = 1.0 / 25.4, kDegree = 180.0 / std::numbers::pi;

/// All that a command reads, sound, and the command.
struct Measurement {
  std::map<std::string, std::string> files;
  std::string command;
};

test::Ran run(const Measurement& m) {
  const TemporaryFolder folder;
  for (const auto& [name, text] : m.files) test::write_text(folder.path() / name, text);
  return test::run_abbe(folder.path(), m.command);
}

/// The first hint: the text after the first of these words, or all that is written.
std::string first_hint(const test::Ran& ran) {
  static const std::regex hints(
      "(they fit (with|as)|all are inside with|fit the plan with|far better with|closer with|"
      "fits with|but only by|repeats line|is also in line|"
      "time must ascend|has a value for run|rows? repeat)");
  const std::string text = ran.err + ran.out;
  std::smatch found;
  return std::regex_search(text, found, hints) ? found.str() + found.suffix().str() : "";
}

/// The hints that a sound file must not have.
bool has_hint(const test::Ran& ran) {
  static const std::regex hints(
      "they fit (with|as)|all are inside with|fit the plan with|far better with|closer "
      "(with|after)|"
      "fits (with|after)|but only by|repeats line|rows? repeat");
  return std::regex_search(ran.err + ran.out, hints);
}

std::string spherical_csv(std::span<const calib::otf::TrackerObservation> samples) {
  std::string text = "time_s,range_mm,azimuth_rad,elevation_rad\n";
  for (const auto& s : samples) {
    const Vector3& p = s.p_tracker_m;
    text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g}\n", s.time_s, 1e3 * p.norm(),
                        std::atan2(p.y(), p.x()), std::asin(p.z() / p.norm()));
  }
  return text;
}

Measurement otf_run(unsigned seed) {
  const auto made = tests::otf::make_run({.seed = seed,
                                          .noise_seed = seed,
                                          .error_scale_m = 10e-6,
                                          .in_datum = true,
                                          .rate_hz = 125.0});
  return {{{"machine.toml", test::made_machine_toml(made.machine.target_offset_m)},
           {"path.csv", test::made_path_csv(made.path)},
           {"tracker.csv", spherical_csv(made.samples)}},
          "identify otf --machine machine.toml --path path.csv --tracker tracker.csv "
          "--accept-path-orientation -o out"};
}

Measurement run_with_scales(unsigned seed) {
  const auto made = tests::otf::make_encoder_run({.seed = seed});
  return {{{"machine.toml", test::made_machine_toml(made.run.machine.target_offset_m)},
           {"path.csv", test::made_path_csv(made.run.path)},
           {"tracker.csv", spherical_csv(made.run.samples)},
           {"encoder.csv", test::made_encoder_csv(made.log)}},
          "identify otf --machine machine.toml --path path.csv --tracker tracker.csv --encoder "
          "encoder.csv -o out"};
}

Measurement verification(unsigned seed) {
  const ModelDocument document = test::synthetic_document(1);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  std::normal_distribution<double> noise(0.0, 2e-6);
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(1.1 + part(random), Vector3(0.2, part(random), 1.0).normalized())
          .toRotationMatrix();
  const Vector3 place(1.5 + 0.5 * part(random), -1.0, 0.4);
  std::string text = "x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
  for (int i = 0; i < 60; ++i) {
    const Vector3 q(0.29 * part(random), 0.29 * part(random), -0.25 + 0.14 * part(random));
    const Vector3 V = document.model.V_at(q, {0.02, -0.015, -0.12});
    const Vector3 p =
        R.transpose() * (q + V - place) + Vector3(noise(random), noise(random), noise(random));
    text += fmt::format("{:.5f},{:.5f},{:.5f},{:.5f},{:.5f},{:.5f}\n", 1e3 * q.x(), 1e3 * q.y(),
                        1e3 * q.z(), 1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z());
  }
  return {{{"model.json", to_json(document)}, {"v.csv", text}}, "verify model.json --points v.csv"};
}

/// Linear between the nodes of the model.
double table_um(const ModelDocument& document, const std::string& name, double position_mm) {
  const auto parameters = document.model.parameters();
  for (std::size_t i = 0; i + 1 < parameters.size(); ++i) {
    const auto &a = parameters[i], &b = parameters[i + 1];
    if (a.name != name || b.name != name) continue;
    const double from = 1e3 * *a.position_m, to = 1e3 * *b.position_m;
    const double u = (position_mm - from) / (to - from);
    if (u > -1e-9 && u < 1.0 + 1e-9) return 1e6 * ((1.0 - u) * a.value + u * b.value);
  }
  return 0.0;
}

Measurement direct_measurement(unsigned seed) {
  const ModelDocument document = test::synthetic_document(1);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.2);
  std::string text = "name,position_mm,value,unit,run,direction\n";
  for (const std::string name : {"EXX", "EYX", "EBX"})
    for (int run = 1; run <= 5; ++run)
      for (const char* direction : {"+", "-"})
        for (int p = -300; p <= 300; p += 50)
          text += fmt::format("{},{},{:.4f},{},{},{}\n", name, p,
                              table_um(document, name, p) + noise(random),
                              name[1] == 'B' ? "urad" : "um", run, direction);
  return {{{"model.json", to_json(document)}, {"m.csv", text}},
          "model compare model.json --measured m.csv --u-um 0.3 --u-urad 0.3"};
}

std::string l_array_toml() {
  const auto c = tests::evemu::reference_calibrator();
  std::string text = "[calibrator]\nname = \"L array\"\ntip_radius_mm = 0\n";
  for (const auto& b : c.balls)
    text += fmt::format(
        "[[ball]]\nnumber = {}\nx_mm = {}\ny_mm = {}\nz_mm = {}\nradius_mm = 12.7\nu_um = 0.5\n",
        b.number, 1e3 * b.centre_m.x(), 1e3 * b.centre_m.y(), 1e3 * b.centre_m.z());
  for (const auto& b : c.blocks)
    text += fmt::format("[[block]]\nnumber = {}\nnormal = [{}, {}, {}]\nu_urad = 5\n", b.number,
                        b.normal.x(), b.normal.y(), b.normal.z());
  return text;
}

/// Of all positions, or of the first one.
std::string touches_csv(bool all, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1e-3);
  std::string text = "position,kind,index,x_mm,y_mm,z_mm\n";
  for (const auto& t : tests::evemu::reference_touches("touched_sig3um.csv"))
    if (all || t.position == 1)
      text += fmt::format("{},{},{},{:.17g},{:.17g},{:.17g}\n", t.position,
                          t.feature == calib::evemu::Feature::Ball ? "ball" : "block", t.number,
                          1e3 * t.p_m.x() + noise(random), 1e3 * t.p_m.y() + noise(random),
                          1e3 * t.p_m.z() + noise(random));
  return text;
}

Measurement ball_array(unsigned seed) {
  return {{{"machine.toml", to_toml(config_tables::weak_portal())},
           {"calibrator.toml", l_array_toml()},
           {"t.csv", touches_csv(true, seed)}},
          "identify evemu --machine machine.toml --touches t.csv --calibrator calibrator.toml "
          "-o out"};
}

Measurement one_position(unsigned seed) {
  return {{{"t.csv", touches_csv(false, seed)}},
          "identify artefact --touches t.csv --name a --tip-radius-mm 0 -o calibrator.toml"};
}

Measurement ball_errors(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (const auto& e : tests::evemu::reference_errors()) {
    // Errors are relative to Ball1: that of Ball1 at the first position is 0.
    const double size = e.V_m.isZero(0.0) ? 0.0 : 1.0;
    const Vector3 V_um = 1e6 * e.V_m + size * Vector3(noise(random), noise(random), noise(random));
    text += fmt::format("{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", e.position,
                        e.ball, 1e3 * e.reading_m.x(), 1e3 * e.reading_m.y(), 1e3 * e.reading_m.z(),
                        V_um.x(), V_um.y(), V_um.z());
  }
  return {{{"machine.toml", to_toml(config_tables::weak_portal())}, {"e.csv", text}},
          "identify evemu --machine machine.toml --errors e.csv -o out"};
}

Measurement bar_of_machine() {
  return {{{"machine.toml", test::reference_machine_toml()},
           {"bar.toml", test::reference_bar_toml()},
           {"plan.toml", test::reference_plan_toml()},
           {"points.csv", test::reference_points_csv()}},
          "identify mfb --machine machine.toml --bar bar.toml --plan plan.toml --points points.csv "
          "-o out"};
}

struct Mistaken {
  std::string name;
  std::function<Measurement(unsigned)> sound;
  std::string file;
  Change change;
  std::string named;  ///< how the first hint begins, a regular expression
};

std::vector<Mistaken> mistaken_files() {
  const auto bar = [](unsigned) { return bar_of_machine(); };
  const std::string angles = "azimuth_rad", elevation = "elevation_rad";
  return {
      {"otf: ranges in m", otf_run, "tracker.csv", scaled({"range_mm"}, 1e-3),
       "they fit with lengths in m instead of mm \\(tracker"},
      {"otf: ranges in inches", otf_run, "tracker.csv", scaled({"range_mm"}, kInch),
       "they fit with lengths in inches instead of mm \\(tracker"},
      {"otf: ranges in um", otf_run, "tracker.csv", scaled({"range_mm"}, 1e3),
       "they fit with lengths in um instead of mm \\(tracker"},
      {"otf: degrees", otf_run, "tracker.csv", scaled({angles, elevation}, kDegree),
       "they fit as degrees"},
      {"otf: zenith", otf_run, "tracker.csv",
       each(elevation, [](double e) { return 0.5 * std::numbers::pi - e; }),
       "they fit (as zenith angles|with zenith angles instead)"},
      {"otf: azimuth reversed", otf_run, "tracker.csv", reversed(angles),
       "they fit with [^;]*azimuth or elevation reversed"},
      {"otf: reflector", otf_run, "tracker.csv",
       each("range_mm", [](double r) { return r + 19.05; }),
       "they fit with ranges shorter by (19|18\\.9)"},
      {"otf: milliseconds", otf_run, "tracker.csv", scaled({"time_s"}, 1e3),
       "they fit as milliseconds"},
      {"otf: a sample twice", otf_run, "tracker.csv", with_a_row_twice, "time must ascend"},
      {"otf: path in inches", otf_run, "path.csv", scaled(kXyz, kInch),
       "they fit with lengths in inches instead of mm \\(path"},
      {"otf: path in m", otf_run, "path.csv", scaled(kXyz, 1e-3),
       "they fit with lengths in m instead of mm \\(path"},
      {"otf: X and Z swapped", otf_run, "path.csv", swapped("x_mm", "z_mm"),
       "all are inside with X and Z swapped"},
      {"otf: Y reversed", otf_run, "path.csv", reversed("y_mm"), "they fit with [^;]*Y reversed"},
      {"otf: backwards", otf_run, "path.csv", backwards(kXyz),
       "they fit with the path driven backwards"},
      {"scales: milliseconds", run_with_scales, "encoder.csv", scaled({"time_s"}, 1e3),
       "they fit as milliseconds"},
      {"verify: points in m", verification, "v.csv", scaled(kTracker, 1e-3),
       "they fit with lengths in m instead of mm \\(measured"},
      {"verify: readings in inches", verification, "v.csv", scaled(kXyz, kInch),
       "they fit with lengths in inches instead of mm \\(readings"},
      {"verify: readings in um", verification, "v.csv", scaled(kXyz, 1e3),
       "they fit with lengths in um instead of mm \\(readings"},
      {"verify: X and Y swapped", verification, "v.csv", swapped("x_mm", "y_mm"),
       "they fit with X and Y swapped \\(readings"},
      {"verify: Y reversed", verification, "v.csv", reversed("y_mm"),
       "they fit with Y reversed \\(readings"},
      {"verify: X and Y reversed", verification, "v.csv", both(reversed("x_mm"), reversed("y_mm")),
       "far better with X and Y reversed \\(readings"},
      {"verify: left-handed", verification, "v.csv", reversed("tracker_x_mm"),
       "they fit with one axis reversed or two axes swapped \\(measured"},
      {"verify: order", verification, "v.csv", backwards(kTracker),
       "they fit with the measured points in the opposite order"},
      {"verify: reflector", verification, "v.csv",
       [](Csv& csv) {
         for (Cells& row : csv.rows) {
           Vector3 p(std::stod(row[3]), std::stod(row[4]), std::stod(row[5]));
           p += 19.05 * p.normalized();
           for (Eigen::Index k = 0; k < 3; ++k)
             row[3 + static_cast<std::size_t>(k)] = fmt::format("{:.5f}", p(k));
         }
       },
       "(far better|they fit) with ranges shorter by 19.0"},
      {"verify: a row twice", verification, "v.csv", with_a_row_twice, "rows? repeat"},
      {"compare: sign", direct_measurement, "m.csv", reversed("value"),
       "fits with the sign of the values reversed"},
      {"compare: positions reversed", direct_measurement, "m.csv", reversed("position_mm"),
       "fits with the (sign of the positions reversed|positions counted from the other end)"},
      {"compare: nm", direct_measurement, "m.csv", scaled({"value"}, 1e3),
       "(fits|closer) with the values divided by (1000|999|1.00e\\+0?3|1e\\+0?3)"},
      {"compare: positions in m", direct_measurement, "m.csv", scaled({"position_mm"}, 1e-3),
       "(fits|closer) with the positions as lengths in m instead of mm"},
      {"compare: a value twice", direct_measurement, "m.csv", with_a_row_twice,
       "has a value for run 1, this direction and position in line 2"},
      {"array: inches", ball_array, "t.csv", scaled(kXyz, kInch),
       "they fit with lengths in inches instead of mm"},
      {"array: um", ball_array, "t.csv", scaled(kXyz, 1e3),
       "all are inside with lengths in um instead of mm"},
      {"array: Y reversed", ball_array, "t.csv", reversed("y_mm"),
       "all are inside with Y reversed"},
      {"array: a touch twice", ball_array, "t.csv", with_a_row_twice, "repeats line 2"},
      {"errors: signs", ball_errors, "e.csv", scaled({"ex_um", "ey_um", "ez_um"}, -1.0),
       "but only by [^ ]* um with all signs reversed"},
      {"errors: readings in inches", ball_errors, "e.csv", scaled(kXyz, kInch),
       "but only by [^ ]* um with lengths in inches instead of mm"},
      {"artefact: m", one_position, "t.csv", scaled(kXyz, 1e-3),
       "they fit with lengths in m instead of mm"},
      {"artefact: a touch twice", one_position, "t.csv", with_a_row_twice, "repeats line 2"},
      {"bar: inches", bar, "points.csv", scaled(kXyz, kInch),
       "fit the plan with lengths in inches instead of mm"},
      {"bar: Y reversed", bar, "points.csv", reversed("y_mm"),
       "(fit the plan|all are inside) with Y reversed"},
  };
}

TEST(UsualMistakes, AreNamedFirst) {
  const auto files = mistaken_files();
  ASSERT_EQ(files.size(), 40u);
  std::size_t named = 0, tried = 0;
  const std::size_t step = files.size() / tests::repetitions(files.size());
  for (std::size_t i = 0; i < files.size(); i += step, ++tried) {
    Measurement m = files[i].sound(1);
    Csv csv = Csv::of(m.files.at(files[i].file));
    files[i].change(csv);
    m.files.at(files[i].file) = csv.text();
    const auto ran = run(m);
    const std::string hint = first_hint(ran);
    const bool right = std::regex_search(hint, std::regex("^(" + files[i].named + ")"));
    named += right ? 1 : 0;
    if (!right)
      std::cout << files[i].name << ": exit " << ran.exit << ", first hint \""
                << hint.substr(0, 200) << "\" of\n"
                << (ran.err + ran.out).substr(0, 600) << '\n';
  }
  EXPECT_GE(20 * named, 19 * tried) << named << " of " << tried;
}

/// 200 sound files of random machines, noise and places of the instrument.
TEST(UsualMistakes, AreNotNamedInSoundFiles) {
  const std::vector<std::pair<std::function<Measurement(unsigned)>, unsigned>> kinds{
      {verification, 100}, {direct_measurement, 60},
      {otf_run, 10},       {run_with_scales, 5},
      {ball_array, 8},     {ball_errors, 8},
      {one_position, 8},   {[](unsigned) { return bar_of_machine(); }, 1}};
  unsigned files = 0;
  for (const auto& [sound, all] : kinds) {
    files += all;
    for (unsigned seed = 1; seed <= tests::repetitions(all) && seed <= all; ++seed) {
      const auto ran = run(sound(seed));
      EXPECT_FALSE(has_hint(ran)) << seed << ": " << ran.err << ran.out;
      EXPECT_TRUE(ran.exit == 0 || ran.exit == 5) << ran.exit << ": " << ran.err;
    }
  }
  EXPECT_EQ(files, 200u);
}

}  // namespace
}  // namespace abbe::daemon
