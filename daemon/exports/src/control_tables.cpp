#include "control_tables.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace abbe::daemon {

double on_table(std::span<const TablePoint> points, double position) {
  if (position <= points.front().position) return points.front().value;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const TablePoint &left = points[i - 1], &right = points[i];
    if (position > right.position) continue;
    const double slope = (right.value - left.value) / (right.position - left.position);
    return left.value + slope * (position - left.position);
  }
  return points.back().value;
}

std::string table_fault(std::span<const TablePoint> points) {
  if (points.size() < 2) return "the table has fewer than 2 points";
  for (std::size_t i = 1; i < points.size(); ++i) {
    if (!(points[i].position > points[i - 1].position))
      return fmt::format("position {} does not follow {} in ascending order", points[i].position,
                         points[i - 1].position);
  }
  return {};
}

std::vector<TextLine> lines_of(std::string_view text, std::string_view comment) {
  std::vector<TextLine> lines;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const auto end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!comment.empty()) line = line.substr(0, line.find(comment));
    lines.push_back({number, line});
  }
  return lines;
}

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view kBlank = " \t\r";
  std::vector<std::string_view> words;
  for (auto begin = line.find_first_not_of(kBlank); begin != std::string_view::npos;
       begin = line.find_first_not_of(kBlank, begin)) {
    const auto end = std::min(line.find_first_of(kBlank, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

std::optional<double> plain_number(std::string_view text) {
  constexpr double kLargest = 1e6;
  double value = 0.0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = fault == std::errc{} && end == text.data() + text.size();
  if (!whole || !(std::abs(value) <= kLargest)) return std::nullopt;
  return value;
}

tl::unexpected<Error> at_line(const std::string& file, std::size_t line, std::string what) {
  return fail(ErrorCode::BadInput,
              fmt::format("{}:{}: {}", file.empty() ? "export" : file, line, what));
}

std::optional<std::size_t> axis_named(const ControlSettings& settings, std::string_view name) {
  for (std::size_t a = 0; a < settings.axis_names.size(); ++a) {
    if (settings.axis_names[a] == name) return a;
  }
  return std::nullopt;
}

namespace {

Result<ControlCorrection> read_one(ExportFormat format, const ExportFile& file,
                                   const ControlSettings& settings) {
  switch (format) {
    case ExportFormat::IsgCsv:
      return read_isg_csv(file, settings);
    case ExportFormat::Etalon:
      return read_etalon(file, settings);
    case ExportFormat::SiemensCec:
      return read_sinumerik_cec(file, settings);
    case ExportFormat::SiemensLec:
      return read_sinumerik_lec(file, settings);
    default:
      return read_csv_grid(file);
  }
}

}  // namespace

Result<ControlCorrection> read_as_control(ExportFormat format, std::span<const ExportFile> files,
                                          const ControlSettings& settings) {
  if (format == ExportFormat::LinuxcncComp) return read_linuxcnc(files);
  if (format == ExportFormat::HeidenhainCom) return read_com_tables(files, settings);
  if (files.size() != 1)
    return fail(ErrorCode::BadInput, fmt::format("export: {} files instead of 1", files.size()));
  return read_one(format, files.front(), settings);
}

}  // namespace abbe::daemon
