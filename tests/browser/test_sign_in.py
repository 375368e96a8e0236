"""The page of a console with accounts: sign-in, the view of each role, and the end of a session."""

import re

import pytest
from playwright.sync_api import expect

from robomesh.schemas.robomesh_pb2 import AuditQuery
from tests.browser.conftest import NO_WEBGL, Plant, run_plant
from tests.browser.robot_page import (
    ARM,
    button,
    joint_values,
    keep_picture,
    region,
    serious,
    stop_notice,
    who_controls,
)
from tests.services.certificates import self_signed
from tests.services.signing_in import PASSWORD, accounts_file
from tests.site import wait_until

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def accounts(tmp_path_factory):
    return accounts_file(tmp_path_factory.mktemp("accounts"))


@pytest.fixture(scope="module")
def plant(accounts, tmp_path_factory):
    """Run a site whose console has accounts and TLS."""
    certificate, key = self_signed(tmp_path_factory.mktemp("tls"))
    settings = {"accounts": accounts, "tls": {"certificate": certificate, "key": key}}
    yield from run_plant(Plant(audit=tmp_path_factory.mktemp("audit"), robots=("arm",), console=settings))


@pytest.fixture
def open_tab(new_context, plant):
    """Yield a function that opens tabs of one browser with shared cookies; check that no error occurs in
    them.
    """
    context = new_context(ignore_https_errors=True)
    wrong = []

    def open_one(path=ARM):
        page = context.new_page()
        page.set_viewport_size({"width": 1440, "height": 900})
        page.add_init_script(NO_WEBGL)  # drawn by the processor here, it would take all of it
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(f"{plant.address}/{path}")
        return page

    yield open_one
    assert wrong == []


def sign_in(page, name, password=PASSWORD):
    page.get_by_label("Account", exact=True).fill(name)
    page.get_by_label("Password", exact=True).fill(password)
    page.keyboard.press("Enter")


def asked_by(plant, request):
    """Return the operators of these requests in the gateway's audit log."""
    asked = plant.session.ask("robomesh/hall/arm/audit/find", AuditQuery(request=request), timeout_s=40)
    return [entry.operator for entry in plant.call(asked).entries]


def account(page):
    """Return the account's menu, in English or Chinese."""
    return page.get_by_role("group", name=re.compile("^(Account|账户)$"))


def signed_in(page):
    return page.get_by_title(re.compile("^(Account: |账户：)"))


def test_an_operator_signs_in_has_control_in_its_own_name_and_signs_out_in_all_tabs(open_tab, plant):
    page = open_tab()
    expect(page.get_by_role("heading", name="Console of hall")).to_be_visible()
    expect(region(page, "Sign in")).to_contain_text("Encrypted connection")
    expect(button(page, "Stop request")).to_be_disabled()
    assert serious(page) == []
    keep_picture(page, "sign-in")
    sign_in(page, "li", "not the password")
    expect(page.get_by_role("alert")).to_have_text("Not signed in: the account or the password is wrong")
    expect(page.get_by_label("Password", exact=True)).to_have_value("")
    sign_in(page, "li")
    expect(signed_in(page)).to_contain_text("operator")
    expect(page.get_by_label("Your name")).to_have_value("li.hall")
    expect(page.get_by_label("Your name")).to_be_disabled()
    button(page, "Take control").click()
    expect(who_controls(page)).to_have_text("You are in control")
    assert "li.hall" in asked_by(plant, "ACQUIRE")
    second = open_tab()
    expect(signed_in(second)).to_contain_text("li")
    signed_in(second).click()
    button(second, "Sign out everywhere").click()
    for tab in (second, page):
        expect(tab.get_by_role("heading", name="Console of hall")).to_be_visible()
        expect(region(tab, "Sign in")).to_contain_text("You have signed out.")
        expect(joint_values(tab)).to_have_count(0)
    # Control ended with the session: the next session finds none in control.
    sign_in(page, "li")
    expect(who_controls(page)).to_have_text("Nobody is in control")


def test_a_monitor_finds_why_it_has_no_control_and_its_stop_request_works(open_tab, plant):
    page = open_tab()
    sign_in(page, "zhao")
    expect(region(page, "Control")).to_contain_text("zhao is a monitor’s account")
    expect(button(page, "Take control")).to_have_count(0)
    button(page, "Stop request").click()
    expect(stop_notice(page)).to_contain_text(re.compile("Stop sent to hall/arm"))
    # The stop went first; it is written down after it.
    wait_until(lambda: "zhao.hall" in asked_by(plant, "STOP"), what="the audit log does not name zhao.hall")


def test_on_a_phone_in_chinese_signing_in_fits_and_has_no_serious_finding(new_context, plant):
    page = new_context(locale="zh-CN", color_scheme="light", ignore_https_errors=True).new_page()
    page.set_viewport_size({"width": 360, "height": 740})
    page.add_init_script(NO_WEBGL)
    page.goto(plant.address)
    expect(page.get_by_role("heading", name="hall 的控制台")).to_be_visible()
    assert serious(page) == []
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    alert = page.get_by_role("alert")
    page.get_by_label("账户", exact=True).fill("li")
    page.get_by_label("密码", exact=True).fill("not the password")
    button(page, "登录").click()
    expect(alert).to_have_text("未登录：账户或密码错误")
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    page.get_by_label("密码", exact=True).fill(PASSWORD)
    button(page, "登录").click()
    expect(signed_in(page)).to_be_visible()
    signed_in(page).click()
    expect(account(page)).to_contain_text("操作员")
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    button(page, "更改密码").click()
    page.get_by_label("当前密码", exact=True).fill(PASSWORD)
    page.get_by_label("新密码", exact=True).fill("short")
    page.get_by_label("再次输入新密码", exact=True).fill("short")
    assert serious(page) == []
    button(page, "更改").click()
    expect(account(page).get_by_role("status")).to_have_text(
        "未更改：密码太短：请用至少 10 个字符，几个词语即可"
    )
