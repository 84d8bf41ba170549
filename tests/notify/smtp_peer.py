"""aiosmtpd as the mail server of a test: it requires STARTTLS and a login, prints its port, and after
one mail what Python's parser of mails found in it as JSON.   smtp_peer.py CERTIFICATE KEY"""
import asyncio
import email
import email.policy
import json
import signal
import ssl
import sys

from aiosmtpd.smtp import SMTP, AuthResult

signal.alarm(60)  # ends it, should the test not send a mail


class Handler:
    async def handle_DATA(self, server, session, envelope):
        mail = email.message_from_bytes(envelope.content, policy=email.policy.default)
        print(json.dumps({
            "tls": session.ssl is not None, "from": envelope.mail_from, "to": envelope.rcpt_tos,
            "subject": str(mail["Subject"]), "header_to": str(mail["To"]), "names": mail.keys(),
            "defects": [str(d) for d in mail.defects], "date": mail["Date"].datetime.isoformat(),
            "body": mail.get_content()}), flush=True)
        asyncio.get_running_loop().call_later(0.5, sys.exit)
        return "250 OK"


def login(server, session, envelope, mechanism, data):
    return AuthResult(success=data.login == b"user" and data.password == b"secret", handled=False)


async def serve():
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    tls.load_cert_chain(sys.argv[1], sys.argv[2])
    loop = asyncio.get_running_loop()
    server = await loop.create_server(
        lambda: SMTP(Handler(), hostname="peer.example", tls_context=tls, require_starttls=True,
                     authenticator=login, auth_required=True), "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


asyncio.run(serve())
