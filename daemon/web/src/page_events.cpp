#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <utility>

#include "abbe/web/client_network.hpp"
#include "page_context.hpp"
#include "responses.hpp"

namespace abbe::web {
namespace {

using Clock = std::chrono::steady_clock;

/// Without an event for this time an empty one is sent, so that both ends notice a lost connection.
constexpr std::chrono::milliseconds kHeartbeat{1000};

/// The stream of one page.
struct Stream {
  PagePlaces::Held place;
  EventBoard::Reader reader;
  httplib::Request request;  ///< with the cookie
  bool begins = true;        ///< the page does not know the number of its place yet
  Clock::time_point sent = Clock::now();
  Clock::time_point checked = Clock::now();
};

/// False once the session of the page has ended. The stream is no use of the session: a page that
/// nobody uses is logged out.
bool may_go_on(PageContext& context, Stream& stream) {
  const auto now = Clock::now();
  if (context.options.settings.web.view_without_login || now - stream.checked < kHeartbeat)
    return true;
  stream.checked = now;
  return session_of(context, stream.request, SessionUse::Look).has_value();
}

bool send_events(PageContext& context, Stream& stream, httplib::DataSink& sink) {
  auto text = stream.reader.next(context.board, kHeartbeat);
  if (stream.place.lost()) {
    context.report.line("place " + stream.request.remote_addr,
                        fmt::format("{}: closed: the page did not report that it reads its events, "
                                    "and another page needed its place ([web] most_pages)",
                                    peer_of(stream.request)));
    text.reset();
  }
  if (!text || !may_go_on(context, stream)) {
    sink.done();
    return true;
  }
  if (text->empty()) *text = "event: alive\ndata: {}\n\n";
  if (std::exchange(stream.begins, false))
    *text = fmt::format("event: place\ndata: {{\"number\":{}}}\n\n", stream.place.number()) + *text;
  if (!sink.write(text->data(), text->size())) return false;
  stream.sent = Clock::now();
  return true;
}

/// False, with an answer, if there is no place for the page.
bool take_place(PageContext& context, const httplib::Request& request, httplib::Response& response,
                PagePlaces::Held& held) {
  const auto place = context.pages.take(client_network(request.remote_addr), Clock::now(), held);
  if (place == PagePlaces::Place::Taken) return true;
  const bool of_address = place == PagePlaces::Place::AllOfAddressTaken;
  const std::size_t most =
      of_address ? context.pages.most_of_address() : context.options.settings.web.most_pages;
  const std::string where = of_address ? " on this computer" : "";
  context.report.line("pages" + (of_address ? " " + request.remote_addr : ""),
                      fmt::format("{}: page refused: {} are open{}, the limit ([web] most_pages)",
                                  peer_of(request), most, where));
  send_error(response, 503, fmt::format("{} pages are open{}, the limit: close one", most, where));
  return false;
}

}  // namespace

void answer_events(PageContext& context, const httplib::Request& request,
                   httplib::Response& response) {
  if (request.version == "HTTP/1.0")
    return send_error(response, 505, "the stream of events needs HTTP/1.1");
  const auto stream = std::make_shared<Stream>();
  stream->request.headers = request.headers;
  stream->request.remote_addr = request.remote_addr;
  stream->request.remote_port = request.remote_port;
  if (!take_place(context, request, response, stream->place)) return;
  response.set_chunked_content_provider(
      "text/event-stream",
      [&context, stream](std::size_t, httplib::DataSink& sink) {
        return send_events(context, *stream, sink);
      },
      [&context, stream, peer = peer_of(request), address = request.remote_addr](bool success) {
        const auto patience = context.options.write_time_out;
        if (success || Clock::now() - stream->sent < patience) return;
        context.report.line("unread " + address,
                            fmt::format("{}: the page does not read its events: closed after {} ms",
                                        peer, patience.count()));
      });
}

}  // namespace abbe::web
