"""What `sonde class --listen` says and lets in: class_door.py ADDRESS WHAT ...

join ADDRESS CODE NAME [ROLE]: prints the HTTP code and the answer's text.
get ADDRESS PATH [SECRET]: the same of a path.
hostile ADDRESS COUNT: opens that many connections that say nothing, or half a greeting, or noise, and
holds them until standard input ends.
fingerprint ADDRESS: SHA-256 of the certificate.
"""
import hashlib
import socket
import ssl
import sys
import urllib.error
import urllib.parse
import urllib.request

PATIENCE_S = 120


def context():
    made = ssl.create_default_context()
    made.check_hostname = False
    made.verify_mode = ssl.CERT_NONE
    return made


def get(url, secret):
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {secret}"} if secret else {})
    try:
        with urllib.request.urlopen(request, context=context(), timeout=PATIENCE_S) as answer:
            print(answer.status, answer.read().decode(errors="replace"))
    except urllib.error.HTTPError as refused:
        print(refused.code, refused.read().decode().strip())


def main(what, address, *rest):
    host, port = urllib.parse.urlsplit(address).hostname, urllib.parse.urlsplit(address).port
    if what == "join":
        code, name, *role = rest
        query = urllib.parse.urlencode({"name": name, "role": role[0] if role else "learner"})
        get(f"{address}join?{query}", code)
    elif what == "get":
        get(address + rest[0], rest[1] if len(rest) > 1 else "")
    elif what == "fingerprint":
        with socket.create_connection((host, port), PATIENCE_S) as plain, context().wrap_socket(plain) as tls:
            digest = hashlib.sha256(tls.getpeercert(True)).hexdigest().upper()
        print(":".join(digest[i : i + 2] for i in range(0, 64, 2)))
    else:
        held = []
        for i in range(int(rest[0])):
            one = socket.create_connection((host, port), PATIENCE_S)
            one.sendall([b"", b"\x16\x03\x01\x02\x00\x01\x00", b"GET / HTTP/1.1\r\n\r\n"][i % 3] or b"")
            held.append(one)
        print("held", flush=True)
        sys.stdin.read()


main(*sys.argv[1:])
