#include "ippdme/session_text.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::drivers::ipp_text {
namespace {

constexpr double kMillimetresPerMetre = 1e3;

/// Texts of three numbers. An error names the number that I++ DME cannot express.
Result<std::array<std::string, 3>> texts_of(const std::array<double, 3>& values, double factor,
                                            const std::array<const char*, 3>& names,
                                            std::string_view unit) {
  std::array<std::string, 3> out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    auto text = ippdme::number_text(factor * values[i]);
    if (!text)
      return tl::unexpected(
          Error{ErrorCode::BadConfiguration,
                fmt::format("{} = {:g}{} cannot be sent: I++ DME has no such number", names[i],
                            factor * values[i], unit)});
    out[i] = std::move(*text);
  }
  return out;
}

Result<std::array<std::string, 3>> place_of(const ProbePoint& p) {
  return texts_of(p.position_m, kMillimetresPerMetre, {"X", "Y", "Z"}, " mm");
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

Result<std::string> go_to(const ProbePoint& p) {
  const auto place = place_of(p);
  ABBE_TRY(place);
  const auto& [x, y, z] = *place;
  return fmt::format("GoTo(X({}),Y({}),Z({}))", x, y, z);
}

Result<std::string> pt_meas(const ProbePoint& p) {
  const auto place = place_of(p);
  ABBE_TRY(place);
  const auto normal = texts_of(p.normal, 1.0, {"I", "J", "K"}, "");
  ABBE_TRY(normal);
  const auto& [x, y, z] = *place;
  const auto& [i, j, k] = *normal;
  return fmt::format("PtMeas(X({}),Y({}),Z({}),IJK({},{},{}))", x, y, z, i, j, k);
}

}  // namespace abbe::drivers::ipp_text

namespace abbe::drivers {

Result<void> check(std::span<const ProbePoint> path) {
  for (std::size_t n = 0; n < path.size(); ++n) {
    const auto text = path[n].touch ? ipp_text::pt_meas(path[n]) : ipp_text::go_to(path[n]);
    if (!text)
      return tl::unexpected(
          Error{text.error().code, fmt::format("target {} of {}: {}: nothing of it is sent", n + 1,
                                               path.size(), text.error().text)});
  }
  return {};
}

}  // namespace abbe::drivers
