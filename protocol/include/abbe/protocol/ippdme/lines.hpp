#pragma once
/// I++ DME: text lines between a client and the server of a measuring machine [I++ DME 1.4.3].
/// Printable ASCII (between quotes any byte but CR LF: servers write their texts in the user's
/// language), CR LF at the end, at most 65536 characters. LineFramer cuts a TCP stream into lines;
/// the parsers are total, give views into the line and take no memory. Units on the wire: mm, s,
/// degrees, Celsius, N.
///
///   CommandLine = (Tag | ETag) SP Name "(" [Argument {"," Argument}] ")"
///   Response    = (Tag | ETag) SP ( "&" | "%" | "#" SP Data | "!" SP Error(F1,F2,F3,"text") )
///   Tag = 5 digits 00001 to 99999; ETag = "E" 4 digits; E0000 is what nobody asked for

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::ippdme {

inline constexpr std::uint16_t kPort = 1294;
inline constexpr std::size_t kMaxLine = 65536;

enum class LineError : std::uint8_t {
  IllegalCharacter,  ///< outside of 32 to 126, and not between quotes
  TooLong,
  BadTag,       ///< not 5 digits, not E and 4 digits, or 00000
  NoSpace,      ///< position 6 is no space
  BadMarker,    ///< position 7 is none of & % # !
  BadError,     ///< not Error(severity, code, origin, "text")
  BadMethod,    ///< no name, no parentheses, or something behind them
  BadArgument,  ///< neither number, string, name, tag nor property
  BadNumber,    ///< more than 16 digits, an exponent of more than 3, no digits
};
/// A literal.
[[nodiscard]] const char* name_of(LineError error) ABBE_RT;

struct Tag {
  bool event = false;  ///< an ETag
  std::uint32_t number = 0;
  friend bool operator==(const Tag&, const Tag&) = default;
};
inline constexpr Tag kUnsolicited{true, 0};
inline constexpr Tag kAbort{true, 2};  ///< of our AbortE
[[nodiscard]] std::string to_string(Tag tag);

struct ErrorReport {
  int severity = 0;  ///< 0 info, 1 warning, 2 the client can mend it, 3 the user must, 9 fatal
  int code = 0;      ///< 0 to 9999
  std::string_view origin;
  std::string_view text;
};

struct Response {
  enum class Kind : std::uint8_t { Ack, Complete, Data, Error };
  Tag tag;
  Kind kind = Kind::Ack;
  std::string_view data;  ///< Data: what follows "# "
  ErrorReport error;      ///< Error
};
/// `line` without its CR LF.
[[nodiscard]] tl::expected<Response, LineError> parse_response(std::string_view line) ABBE_RT;

struct CommandLine {
  Tag tag;
  std::string_view method;
  std::string_view arguments;  ///< between the parentheses
};
[[nodiscard]] tl::expected<CommandLine, LineError> parse_command(std::string_view line) ABBE_RT;

/// One argument, or one value of a response's data.
struct Argument {
  enum class Kind : std::uint8_t { Number, String, Name, Property };
  static constexpr std::size_t kMostNumbers = 8;
  Kind kind = Kind::Name;
  std::string_view
      text;  ///< of a name (also a tag) or property its name, of a string what is in it
  std::array<double, kMostNumbers> numbers{};  ///< of a number or a property
  std::size_t count = 0;
};

/// Walks "X(1.5),Y(2),IJK(0,0,1),"text",7".
class ArgumentReader {
 public:
  explicit ArgumentReader(std::string_view text) ABBE_RT : rest_(text) {}
  /// Nothing at the end; after an error nothing more.
  [[nodiscard]] std::optional<tl::expected<Argument, LineError>> next() ABBE_RT;

 private:
  std::string_view rest_;
  bool first_ = true;
};

/// What a machine reports of a place: Get, PtMeas, OnMoveReportE. In mm, as on the wire.
struct PointReport {
  std::array<double, 3> p_mm{};
  std::uint8_t known = 0;  ///< bit i: X, Y, Z was there
  std::array<double, 3> ijk{};
  bool has_ijk = false;
};
/// Properties that are not of a place are passed over.
[[nodiscard]] tl::expected<PointReport, LineError> parse_point(std::string_view data) ABBE_RT;

/// A number as the grammar writes it, at most 16 digits. NaN and infinity are written as 0.
[[nodiscard]] std::string number_text(double value);

class LineFramer {
 public:
  static constexpr std::size_t kCapacity = 2 * (kMaxLine + 2);

  /// Takes as many bytes as there is room for and says how many; all, whenever next() was called
  /// until it gave nothing and no more than kMaxLine come at once.
  std::size_t push(std::span<const std::byte> bytes) ABBE_RT;
  /// The next line without its end, valid until the next push() or reset(). An error once; then
  /// nothing until reset() or resume(): the peer speaks something else.
  [[nodiscard]] std::optional<tl::expected<std::string_view, LineError>> next() ABBE_RT;
  /// After an error: continues behind the next end of a line. Called before next(), what came with
  /// the illegal byte is not lost.
  void resume() ABBE_RT;
  void reset() ABBE_RT;

 private:
  [[nodiscard]] tl::unexpected<LineError> refuse(LineError error) ABBE_RT;

  std::array<char, kCapacity> buffer_{};
  std::size_t begin_ = 0;
  std::size_t looked_ = 0;  ///< before this is neither an end of line nor an illegal character
  std::size_t end_ = 0;
  bool broken_ = false;
  bool skipping_ = false;  ///< to the next end of a line
  bool quoted_ = false;    ///< at looked_
};

}  // namespace abbe::protocol::ippdme
