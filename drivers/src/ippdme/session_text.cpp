#include "ippdme/session_text.hpp"

#include <fmt/format.h>

namespace abbe::drivers::ipp_text {
namespace {

constexpr double kMillimetresPerMetre = 1e3;

std::string mm(double m) {
  return ippdme::number_text(kMillimetresPerMetre * m);
}

}  // namespace

double seconds(std::chrono::nanoseconds d) {
  return 1e-9 * static_cast<double>(d.count());
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c >= ' ' && c <= '~') {
      out += c;
    } else {
      out += fmt::format("\\x{:02X}", static_cast<unsigned char>(c));
    }
  }
  return out;
}

std::string text_of(const IppError& e) {
  return fmt::format("{:04} {} (severity {})", e.code, escaped(e.text.view()), e.severity);
}

std::string_view method_name(std::string_view method) {
  return method.substr(0, method.find('('));
}

std::string go_to(const ProbePoint& p) {
  return fmt::format("GoTo(X({}),Y({}),Z({}))", mm(p.position_m[0]), mm(p.position_m[1]),
                     mm(p.position_m[2]));
}

std::string pt_meas(const ProbePoint& p) {
  const auto number = [](double v) { return ippdme::number_text(v); };
  return fmt::format("PtMeas(X({}),Y({}),Z({}),IJK({},{},{}))", mm(p.position_m[0]),
                     mm(p.position_m[1]), mm(p.position_m[2]), number(p.normal[0]),
                     number(p.normal[1]), number(p.normal[2]));
}

}  // namespace abbe::drivers::ipp_text
