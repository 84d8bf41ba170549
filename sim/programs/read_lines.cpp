#include "read_lines.hpp"

#include <cmath>
#include <numbers>

namespace abbe::sim {

void read_line_output(Section& section, LineOutput& output) {
  section.get_word<LineTransport>("transport", output.transport,
                                  {{"tcp", LineTransport::Tcp},
                                   {"tcp-server", LineTransport::TcpServer},
                                   {"udp", LineTransport::Udp},
                                   {"serial", LineTransport::Serial}});
  section.get("serial", output.link);
}

void read_line_syntax(Section& section, lines::LineSyntax& syntax) {
  section.get_word<lines::TimeUnit>("time_unit", syntax.time_unit,
                                    {{"s", lines::TimeUnit::Seconds},
                                     {"ms", lines::TimeUnit::Milliseconds},
                                     {"us", lines::TimeUnit::Microseconds},
                                     {"ns", lines::TimeUnit::Nanoseconds}});
  section.get_word<char>("separator", syntax.separator,
                         {{"space", ' '}, {"tab", '\t'}, {"comma", ','}, {"semicolon", ';'}});
  section.get_word<char>("decimal", syntax.decimal_sign, {{"point", '.'}, {"comma", ','}});
  std::vector<std::string> valid;
  if (!section.get("valid_status", valid)) return;
  syntax.valid_status_count = 0;

  for (const std::string& text : valid) {
    const auto word = lines::StatusWord::from(text);
    if (!word || syntax.valid_status_count == lines::LineSyntax::kMostWords)
      return section.fault("valid_status", "has too many words, or one that is too long");
    syntax.valid_status[syntax.valid_status_count++] = *word;
  }
}

void read_line_units(Section& section, double& metres_per_length, double& radians_per_angle) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  section.get_word<double>("length_unit", metres_per_length,
                           {{"mm", 1e-3}, {"m", 1.0}, {"um", 1e-6}, {"inch", 0.0254}});
  section.get_word<double>(
      "angle_unit", radians_per_angle,
      {{"rad", 1.0}, {"deg", kDegree}, {"gon", kDegree * 0.9}, {"mrad", 1e-3}});
}

void read_line_rate(Section& section, std::string_view key, std::chrono::nanoseconds& separation) {
  double rate_hz = 0.0;
  if (section.get(key, rate_hz, kPlain, {0.1, 10e3}))
    separation = std::chrono::nanoseconds{std::llround(1e9 / rate_hz)};
}

}  // namespace abbe::sim
