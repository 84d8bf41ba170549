#include "abbe/config/kinds/tracker_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/faults.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "plausible.hpp"
#include "read_lines.hpp"

namespace abbe::daemon {
namespace {

namespace lines = protocol::lines;
using lines::Column;
using lines::LineFormat;

enum class LineTransport { Tcp, TcpServer, Udp, Serial };

constexpr std::array kColumns{Column::Ignored, Column::X,       Column::Y,         Column::Z,
                              Column::Range,   Column::Azimuth, Column::Elevation, Column::Zenith,
                              Column::Time,    Column::Status};
constexpr double kDegree_rad = std::numbers::pi / 180.0;

const std::vector<std::pair<std::string_view, double>> kLengthUnits{
    {"mm", 1e-3}, {"m", 1.0}, {"um", 1e-6}, {"inch", 0.0254}};
const std::vector<std::pair<std::string_view, double>> kAngleUnits{
    {"rad", 1.0}, {"deg", kDegree_rad}, {"gon", 0.9 * kDegree_rad}, {"mrad", 1e-3}};
const std::vector<std::pair<std::string_view, lines::TimeUnit>> kTimeUnits{
    {"s", lines::TimeUnit::Seconds},
    {"ms", lines::TimeUnit::Milliseconds},
    {"us", lines::TimeUnit::Microseconds},
    {"ns", lines::TimeUnit::Nanoseconds}};

template <class Value>
std::string_view line_word_of(const std::vector<std::pair<std::string_view, Value>>& words,
                              const Value& value) {
  const auto found = std::ranges::find(words, value, &std::pair<std::string_view, Value>::second);
  return found == words.end() ? "?" : found->first;
}

std::string all_columns() {
  std::string text;
  for (const Column column : kColumns)
    text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", lines::name_of(column));
  return text;
}

void read_columns_of_line(ClassifiedSection& section, LineFormat& format) {
  std::vector<std::string> names;
  section.get(measurement("columns"), names);
  if (names.empty())
    return section.fault("columns", fmt::format("missing: the columns of a line in their order, "
                                                "of {}; `abbe probe-lines` finds them",
                                                all_columns()));
  if (names.size() > LineFormat::kMostColumns)
    return section.fault("columns", fmt::format("must be at most {}", LineFormat::kMostColumns));
  for (const std::string& name : names) {
    const auto* const column =
        std::ranges::find(kColumns, name, [](Column c) { return lines::name_of(c); });
    if (column == kColumns.end())
      return section.fault("columns", fmt::format("\"{}\" must be one of {} (\"-\" is ignored)",
                                                  name, all_columns()));
    format.columns[format.column_count++] = *column;
  }
}

void read_valid_status(ClassifiedSection& section, Role role, bool has_column,
                       lines::LineSyntax& format) {
  std::vector<std::string> words;
  section.get(Key{"valid_status", role}, words);
  if (has_column == !words.empty()) {
    if (words.size() > LineFormat::kMostWords)
      return section.fault("valid_status",
                           fmt::format("must be at most {} words", LineFormat::kMostWords));
    for (const std::string& text : words) {
      const auto word = lines::StatusWord::from(text);
      if (!word)
        return section.fault("valid_status", fmt::format("a word must have 1 to {} bytes",
                                                         lines::StatusWord::kCapacity));
      format.valid_status[format.valid_status_count++] = *word;
    }
    return;
  }
  section.fault("valid_status", has_column
                                    ? "missing: the status of the points that may be used, such as "
                                      "[\"0\", \"OK\"]; all other points are invalid"
                                    : "has no meaning: no column is \"status\"");
}

LineFormat read_format(ClassifiedSection& section) {
  LineFormat format;
  read_columns_of_line(section, format);
  section.get_word<double>(measurement("length_unit"), format.metres_per_length, kLengthUnits,
                           Need::Required);
  section.get_word<double>(measurement("angle_unit"), format.radians_per_angle, kAngleUnits,
                           format.has(Column::Azimuth) ? Need::Required : Need::Optional);
  read_line_syntax(section, Role::Measurement, format.has(Column::Status), format);
  if (format.column_count == 0) return format;
  if (const auto what = lines::format_fault(format); !what.empty()) section.fault("columns", what);
  const auto unused = [&](std::string_view key, bool used) {
    if (section.has(key) && !used) section.fault(key, "has no meaning: no column has this unit");
  };
  unused("angle_unit", format.has(Column::Azimuth));
  unused("time_unit", format.has(Column::Time));
  return format;
}

drivers::LineSerial read_serial(ClassifiedSection& section) {
  drivers::LineSerial line;
  section.get(operation("serial"), line.path, Need::Required);
  section.get_integer(operation("baud"), line.baud, 300, 1'000'000);
  section.get_word<drivers::Parity>(operation("parity"), line.parity,
                                    {{"none", drivers::Parity::None},
                                     {"even", drivers::Parity::Even},
                                     {"odd", drivers::Parity::Odd}});
  section.get_integer(operation("stop_bits"), line.stop_bits, 1, 2);
  return line;
}

drivers::LineAddress read_any_address(ClassifiedSection& section) {
  LineTransport transport = LineTransport::Tcp;
  section.get_word<LineTransport>(operation("transport"), transport,
                                  {{"tcp", LineTransport::Tcp},
                                   {"tcp-server", LineTransport::TcpServer},
                                   {"udp", LineTransport::Udp},
                                   {"serial", LineTransport::Serial}},
                                  Need::Required);
  const bool serial = transport == LineTransport::Serial;
  for (const auto key : {"host", "port"})
    if (serial && section.has(key))
      section.fault(key, "has no meaning with transport = \"serial\"");
  for (const auto key : {"serial", "baud", "parity", "stop_bits"})
    if (!serial && section.has(key))
      section.fault(key, "has a meaning only with transport = \"serial\"");
  if (serial) return read_serial(section);

  drivers::LineTcp peer;
  get_host(section, operation("host"), peer.host, Need::Required);
  section.get_integer(operation("port"), peer.port, 1, 65535, Need::Required);
  if (transport == LineTransport::TcpServer) return drivers::LineTcpServer{peer.host, peer.port};
  if (transport == LineTransport::Udp) return drivers::LineUdp{peer.host, peer.port};
  return peer;
}

std::string toml_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

std::string toml_texts(const std::vector<std::string>& texts) {
  std::string out;
  for (const std::string& text : texts) out += (out.empty() ? "" : ", ") + toml_text(text);
  return "[" + out + "]";
}

/// Lines "key = value" of the keys that are stated.
class StatedKeys {
 public:
  void add(std::string_view key, std::string_view text) {
    if (!text.empty()) add_value(key, toml_text(text));
  }
  void add(std::string_view key, const std::vector<std::string>& texts) {
    if (!texts.empty()) add_value(key, toml_texts(texts));
  }
  void add(std::string_view key, int number) {
    if (number != 0) add_value(key, fmt::format("{}", number));
  }
  void add(std::string_view key, double number) {
    if (number != 0.0) add_value(key, fmt::format("{:.6g}", number));
  }
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  void add_value(std::string_view key, std::string_view value) {
    text_ += fmt::format("{} = {}\n", key, value);
  }
  std::string text_;
};

void add_address(const StatedLines& stated, StatedKeys& keys) {
  keys.add("transport", stated.transport);
  keys.add("host", stated.host);
  keys.add("port", stated.port);
  keys.add("serial", stated.serial);
  keys.add("baud", stated.baud);
  keys.add("parity", stated.parity);
  keys.add("stop_bits", stated.stop_bits);
}

}  // namespace

std::string tracker_table(const StatedLines& stated) {
  StatedKeys keys;
  keys.add("protocol", "lines");
  add_address(stated, keys);
  keys.add("columns", stated.columns);
  keys.add("valid_status", stated.valid_status);
  keys.add("length_unit", stated.length_unit);
  keys.add("angle_unit", stated.angle_unit);
  keys.add("time_unit", stated.time_unit);
  keys.add("separator", stated.separator);
  keys.add("decimal", stated.decimal);
  keys.add("point_rate_hz", stated.point_rate_hz);
  if (stated.stationary_time_ms != 0) keys.add("mode", "stationary");
  keys.add("stationary_time_ms", stated.stationary_time_ms);
  keys.add("weather", stated.weather);
  return "[tracker]\n" + keys.text();
}

Result<drivers::LineAddress> line_address(const StatedLines& stated) {
  StatedKeys keys;
  add_address(stated, keys);
  const auto table = parse_toml(keys.text(), "options");
  ABBE_TRY(table);
  Faults faults("options", kMostConfigFaults);
  Meaning unused;
  ClassifiedSection section{Section{&*table, "", {1, 1}, faults, Origin::Written}, "", unused};
  auto address = read_any_address(section);
  if (!faults.any())
    if (const auto valid = drivers::check(address); !valid)
      return fail(ErrorCode::Usage, valid.error().text);
  if (!faults.any()) return address;
  Error error = faults.to_error();
  error.code = ErrorCode::Usage;
  return tl::make_unexpected(std::move(error));
}

const std::vector<std::pair<std::string_view, double>>& line_length_units() {
  return kLengthUnits;
}

const std::vector<std::pair<std::string_view, double>>& line_angle_units() {
  return kAngleUnits;
}

void read_line_syntax(ClassifiedSection& section, Role role, bool has_status,
                      lines::LineSyntax& format) {
  section.get_word<lines::TimeUnit>(Key{"time_unit", role}, format.time_unit, kTimeUnits);
  section.get_word<char>(operation("separator"), format.separator,
                         {{"space", ' '}, {"tab", '\t'}, {"comma", ','}, {"semicolon", ';'}});
  section.get_word<char>(operation("decimal"), format.decimal_sign,
                         {{"point", '.'}, {"comma", ','}});
  read_valid_status(section, role, has_status, format);
}

drivers::LineAddress read_line_address(ClassifiedSection& section) {
  auto address = read_any_address(section);
  const auto valid = drivers::check(address);
  const bool given = section.has("host") ? section.has("port") : section.has("serial");
  if (!valid && given) section.fault(section.has("host") ? "host" : "baud", valid.error().text);
  return address;
}

std::string format_text(const LineFormat& format) {
  std::string text;
  for (std::size_t i = 0; i < format.column_count; ++i)
    text += fmt::format("{}{}", i == 0 ? "" : " ", lines::name_of(format.columns[i]));
  text += fmt::format(", {}", line_word_of(kLengthUnits, format.metres_per_length));
  if (format.has(Column::Azimuth))
    text += fmt::format(", {}", line_word_of(kAngleUnits, format.radians_per_angle));
  if (format.has(Column::Time))
    text += fmt::format(", {}", line_word_of(kTimeUnits, format.time_unit));
  return text;
}

LinesConfig read_lines(ClassifiedSection& section) {
  return {.address = read_line_address(section), .format = read_format(section)};
}

void refuse_lines_keys(ClassifiedSection& section) {
  for (const auto key :
       {"transport", "serial", "baud", "parity", "stop_bits", "columns", "length_unit",
        "angle_unit", "time_unit", "separator", "decimal", "valid_status"})
    if (section.has(key)) section.fault(key, "has a meaning only with protocol = \"lines\"");
}

}  // namespace abbe::daemon
