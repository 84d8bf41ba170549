#include "abbe/exports/write_export.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "writers.hpp"

namespace abbe::daemon {
namespace {

std::string without_minus_zero(std::string text) {
  const bool zero = text.find_first_not_of("-0.") == std::string::npos;
  return zero && text.front() == '-' ? text.substr(1) : text;
}

/// `text` with "?" for characters that a control may not accept, and on one line, so that it can be
/// a comment.
std::string printable(std::string_view text) {
  std::string out;
  for (const char c : text) out += c >= ' ' && c <= '~' ? c : '?';
  return out;
}

/// Adds `text`, divided into several lines: reasons may be long, and a control may limit the length
/// of a line.
void add_lines(std::string_view text, std::vector<std::string>& lines) {
  constexpr std::size_t kLongest = 100;
  while (text.size() > kLongest) {
    auto end = text.rfind(' ', kLongest);
    if (end == std::string_view::npos || end == 0) end = kLongest;
    lines.emplace_back(text.substr(0, end));
    text.remove_prefix(text[end] == ' ' ? end + 1 : end);
  }
  lines.emplace_back(text);
}

/// The statements of a file, one line each.
std::vector<std::string> statements_of(const ExportOrigin& origin, std::string_view sign) {
  std::vector<std::string> all{fmt::format("abbe export of model {}", origin.model_hash)};
  for (const std::string& text : origin.use) add_lines(printable(text), all);
  all.push_back(fmt::format("machine: {}", printable(origin.machine)));
  all.push_back(fmt::format("valid for {}, tool offset {}", printable(origin.volume),
                            printable(origin.tool)));
  if (!origin.direction.empty())
    all.push_back(fmt::format("direction of travel: {}", printable(origin.direction)));
  all.emplace_back(sign);
  return all;
}

Result<void> check_nodes(const FormatFacts& facts, const calib::GridAxes& nodes_m) {
  for (const calib::Axis axis : calib::kAllAxes) {
    const auto count = nodes_m[calib::index(axis)].size();
    if (facts.most_nodes != 0 && count > facts.most_nodes)
      return fail(ErrorCode::Usage,
                  fmt::format("{}: {} nodes on axis {}; the control takes at most {}: give a "
                              "larger --step-mm",
                              facts.name, count, calib::letter(axis), facts.most_nodes));
  }
  return {};
}

ExportFiles write_tables(ExportFormat format, const calib::HeldTables& held,
                         const WriteOptions& options) {
  switch (format) {
    case ExportFormat::IsgCsv:
      return write_isg_csv(held, options);
    case ExportFormat::Etalon:
      return write_etalon(held, options);
    case ExportFormat::LinuxcncComp:
      return write_linuxcnc(held);
    case ExportFormat::SiemensCec:
      return write_siemens_cec(held, options);
    case ExportFormat::SiemensLec:
      return write_siemens_lec(held, options);
    case ExportFormat::HeidenhainCom:
      return write_heidenhain(held, options);
    case ExportFormat::CsvGrid:
      break;
  }
  return {};
}

}  // namespace

std::string fixed_mm(double value_m) {
  return without_minus_zero(fmt::format("{:.9f}", value_m * kMmPerM));
}

std::string file_value(const calib::HeldTable& table, std::size_t i, int positive_moves,
                       int direction) {
  double value = table.value[i];
  if (!table.half_forward.empty()) value += direction * table.half_forward[i];
  value *= positive_moves;
  return calib::is_rotation(table.motion.motion) ? without_minus_zero(fmt::format("{:.12f}", value))
                                                 : fixed_mm(value);
}

std::string sign_text(int positive_moves) {
  return fmt::format("sign: a positive value moves the axis in the {} direction",
                     positive_moves > 0 ? "positive" : "negative");
}

std::string origin_comment(const ExportOrigin& origin, std::string_view mark,
                           std::string_view sign) {
  std::string text;
  for (const std::string& statement : statements_of(origin, sign))
    text += fmt::format("{} {}\n", mark, statement);
  return text;
}

std::string origin_in_one_line(const ExportOrigin& origin, std::string_view sign) {
  return fmt::format("{}", fmt::join(statements_of(origin, sign), "; "));
}

Result<std::vector<ExportFile>> write_export(ExportFormat format, const HeldCorrection& held,
                                             const WriteOptions& options) {
  if (const auto* grid = std::get_if<calib::HeldGrid>(&held); grid != nullptr)
    return write_csv_grid(*grid, options);

  const auto& tables = std::get<calib::HeldTables>(held);
  ABBE_TRY(check_nodes(facts_of(format), tables.nodes_m));
  return write_tables(format, tables, options);
}

}  // namespace abbe::daemon
