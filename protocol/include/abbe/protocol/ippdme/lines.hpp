#pragma once
/// I++ DME: text lines between a client and the server of a measuring machine [I++ DME 1.4.3].
/// Lines consist of printable ASCII (between quotes any byte except CR LF: servers write texts in
/// the user's language), end with CR LF, and have at most 65536 characters. LineFramer splits a TCP
/// stream into lines. The parsers accept any bytes, return views into the line, and do not
/// allocate. Units on the wire: mm, s, degrees, Celsius, N.
///
///   CommandLine = (Tag | ETag) SP Name "(" [Argument {"," Argument}] ")"
///   Response    = (Tag | ETag) SP ( "&" | "%" | "#" SP Data | "!" SP Error(F1,F2,F3,"text") )
///   Tag = 5 digits 00001 to 99999; ETag = "E" 4 digits; E0000: unsolicited

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
  IllegalCharacter,  ///< code outside 32 to 126, and not between quotes
  TooLong,
  BadTag,       ///< not 5 digits, not E and 4 digits, or 00000
  NoSpace,      ///< character 6 is not a space
  BadMarker,    ///< character 7 is none of & % # !
  BadError,     ///< not Error(severity, code, origin, "text")
  BadMethod,    ///< no name, no parentheses, or characters after them
  BadArgument,  ///< not a number, string, name, tag or property
  BadNumber,    ///< more than 16 digits, an exponent of more than 3, no digits
};
/// Text for messages.
[[nodiscard]] const char* name_of(LineError error) ABBE_RT;

struct Tag {
  bool event = false;  ///< an ETag
  std::uint32_t number = 0;
  friend bool operator==(const Tag&, const Tag&) = default;
};
inline constexpr Tag kUnsolicited{true, 0};
inline constexpr Tag kAbort{true, 2};  ///< used for AbortE
[[nodiscard]] std::string to_string(Tag tag);

struct ErrorReport {
  int severity = 0;  ///< 0 info, 1 warning, 2 client can repair, 3 user must repair, 9 fatal
  int code = 0;      ///< 0 to 9999
  std::string_view origin;
  std::string_view text;
};

struct Response {
  enum class Kind : std::uint8_t { Ack, Complete, Data, Error };
  Tag tag;
  Kind kind = Kind::Ack;
  std::string_view data;  ///< Data: the text after "# "
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
  std::string_view text;  ///< name of a name, tag or property; content of a string
  std::array<double, kMostNumbers> numbers{};  ///< value of a number; values of a property
  std::size_t count = 0;
};

/// Reads a list of arguments such as X(1.5),Y(2),IJK(0,0,1),"text",7 one by one.
class ArgumentReader {
 public:
  explicit ArgumentReader(std::string_view text) ABBE_RT : rest_(text) {}
  /// The next argument; nullopt at the end, and after an error was returned.
  [[nodiscard]] std::optional<tl::expected<Argument, LineError>> next() ABBE_RT;

 private:
  std::string_view rest_;
  bool first_ = true;
};

/// A position reported by a machine: Get, PtMeas, OnMoveReportE. In mm, as on the wire.
struct PointReport {
  std::array<double, 3> p_mm{};
  std::uint8_t known = 0;  ///< bit 0, 1, 2: X, Y, Z was reported
  std::array<double, 3> ijk{};
  bool has_ijk = false;
};
/// Parses the data of a PointReport. Properties other than X, Y, Z and IJK are ignored.
[[nodiscard]] tl::expected<PointReport, LineError> parse_point(std::string_view data) ABBE_RT;

/// A number in the grammar of I++ DME, with at most 16 digits. nullopt: there is no such number
/// (NaN, infinity, magnitude of 1e15 or more).
[[nodiscard]] std::optional<std::string> number_text(double value);

class LineFramer {
 public:
  static constexpr std::size_t kCapacity = 2 * (kMaxLine + 2);

  /// Takes as many bytes as fit and returns their number. All bytes fit if next() was called until
  /// it returned nullopt and there are at most kMaxLine bytes.
  std::size_t push(std::span<const std::byte> bytes) ABBE_RT;
  /// The next line without CR LF, valid until the next push() or reset(). An error is returned
  /// once, then nullopt until reset() or resume(): the peer violates the protocol.
  [[nodiscard]] std::optional<tl::expected<std::string_view, LineError>> next() ABBE_RT;
  /// After an error: skips the rest of the refused line and continues after its end. If resume() is
  /// called before the next call of next(), no later line of the bytes already pushed is lost.
  void resume() ABBE_RT;
  void reset() ABBE_RT;

 private:
  [[nodiscard]] tl::unexpected<LineError> refuse(LineError error) ABBE_RT;

  std::array<char, kCapacity> buffer_{};
  std::size_t begin_ = 0;
  std::size_t looked_ = 0;  ///< bytes before this index have no end of line, no illegal character
  std::size_t end_ = 0;
  bool broken_ = false;
  bool skipping_ = false;  ///< skips bytes up to the next end of a line
  bool quoted_ = false;    ///< looked_ is between quotes
};

}  // namespace abbe::protocol::ippdme
