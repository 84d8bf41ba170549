#include "abbe/methods/otf/path_program.hpp"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/calib/otf/run/polyline.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;

constexpr double kSecondsPerMinute = 60.0;

/// The statements of one dialect. Blocks are joined by the caller.
struct ProgramText {
  std::vector<std::string> begin;
  std::vector<std::string> end;
  std::string (*comment)(const std::string& text);
  std::string (*move)(const Vector3& q_m, double feed_mm_per_min);
  std::string stop;
  std::vector<std::string> (*dwell)(double seconds);
};

/// The number with at most four decimals and without a negative zero: "-300", "12.5".
std::string decimal(double value) {
  constexpr double kPerUnit = 1e4;
  const double rounded = std::round(value * kPerUnit) / kPerUnit + 0.0;
  std::string text = fmt::format("{:.4f}", rounded);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// The number with a sign, as Heidenhain controls require it.
std::string signed_decimal(double value) {
  const std::string text = decimal(value);
  return text.front() == '-' ? text : "+" + text;
}

ProgramText linuxcnc_text() {
  return {.begin = {"G21 G17 G40 G49 G80 G90 G94", "G61.1"},
          .end = {"M2"},
          .comment = [](const std::string& text) { return "(" + text + ")"; },
          .move =
              [](const Vector3& q_m, double feed) {
                return fmt::format("G53 G1 X{} Y{} Z{} F{}", decimal(q_m[0] * kMmPerM),
                                   decimal(q_m[1] * kMmPerM), decimal(q_m[2] * kMmPerM),
                                   decimal(feed));
              },
          .stop = "M0",
          .dwell = [](double s) { return std::vector{"G4 P" + decimal(s)}; }};
}

ProgramText siemens_text() {
  return {.begin = {"G17 G40 G710 G90 G94 G60", "D0"},
          .end = {"M30"},
          .comment = [](const std::string& text) { return "; " + text; },
          .move =
              [](const Vector3& q_m, double feed) {
                return fmt::format("SUPA G1 X{} Y{} Z{} F{}", decimal(q_m[0] * kMmPerM),
                                   decimal(q_m[1] * kMmPerM), decimal(q_m[2] * kMmPerM),
                                   decimal(feed));
              },
          .stop = "M0",
          .dwell = [](double s) { return std::vector{"G4 F" + decimal(s)}; }};
}

ProgramText heidenhain_text() {
  return {.begin = {"BEGIN PGM OTFPATH MM"},
          .end = {"END PGM OTFPATH MM"},
          .comment = [](const std::string& text) { return "; " + text; },
          .move =
              [](const Vector3& q_m, double feed) {
                return fmt::format("L X{} Y{} Z{} R0 F{} M91", signed_decimal(q_m[0] * kMmPerM),
                                   signed_decimal(q_m[1] * kMmPerM),
                                   signed_decimal(q_m[2] * kMmPerM), decimal(feed));
              },
          .stop = "STOP",
          .dwell =
              [](double s) {
                return std::vector<std::string>{"CYCL DEF 9.0 DWELL TIME",
                                                "CYCL DEF 9.1 DWELL " + decimal(s)};
              }};
}

ProgramText text_of(Dialect dialect) {
  switch (dialect) {
    case Dialect::LinuxCnc:
      break;
    case Dialect::Siemens:
      return siemens_text();
    case Dialect::Heidenhain:
      return heidenhain_text();
  }
  return linuxcnc_text();
}

/// The blocks with numbers: Siemens N10 N20 .., Heidenhain 0 1 2 .., LinuxCNC none.
std::string numbered(const std::vector<std::string>& blocks, Dialect dialect) {
  std::string text;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (dialect == Dialect::Siemens && !blocks[i].starts_with(';'))
      text += fmt::format("N{} ", 10 * (i + 1));
    if (dialect == Dialect::Heidenhain) text += fmt::format("{} ", i);
    text += blocks[i] + "\n";
  }
  return text;
}

}  // namespace

std::string_view name(Dialect dialect) noexcept {
  switch (dialect) {
    case Dialect::LinuxCnc:
      break;
    case Dialect::Siemens:
      return "siemens";
    case Dialect::Heidenhain:
      return "heidenhain";
  }
  return "linuxcnc";
}

std::string_view extension(Dialect dialect) noexcept {
  switch (dialect) {
    case Dialect::LinuxCnc:
      break;
    case Dialect::Siemens:
      return ".mpf";
    case Dialect::Heidenhain:
      return ".h";
  }
  return ".ngc";
}

std::optional<Dialect> dialect_named(std::string_view wanted) noexcept {
  for (const Dialect dialect : kDialects) {
    if (name(dialect) == wanted) return dialect;
  }
  return std::nullopt;
}

std::string path_program(const calib::otf::Path& path, const calib::otf::Drive& drive,
                         double stand_s, Dialect dialect) {
  const ProgramText program = text_of(dialect);
  const double feed = drive.feed_m_per_s * kMmPerM * kSecondsPerMinute;
  std::vector<std::string> blocks = program.begin;
  const auto add = [&blocks](const std::vector<std::string>& more) {
    blocks.insert(blocks.end(), more.begin(), more.end());
  };

  add({program.comment(fmt::format("abbe on-the-fly calibration: {} legs, {:.1f} m, {:.0f} s",
                                   path.vertices_m.size() - 1,
                                   calib::otf::lengths_to_vertices_m(path).back(),
                                   duration_s(path, drive) + 2.0 * stand_s)),
       program.comment("machine coordinates; the whole travel must be free; no tool offset"),
       program.move(path.vertices_m.front(), feed),
       program.comment(
           "start abbe calibrate otf, continue when it shows READY: drive the path now"),
       program.stop});
  add(program.dwell(stand_s));

  for (std::size_t i = 1; i < path.vertices_m.size(); ++i) {
    blocks.push_back(program.move(path.vertices_m[i], feed));
    const bool last = i + 1 == path.vertices_m.size();
    if (last || drive.dwell_s > 0.0) add(program.dwell(last ? stand_s : drive.dwell_s));
  }

  add(program.end);
  return numbered(blocks, dialect);
}

}  // namespace abbe::daemon
